"""Whether a dataset fits a rig, and the rig's model for the recordings of the dataset."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from wingfit.records import SeriesDataset
from wingfit.rigs.rig import Rig
from wingfit.rigs.rig_model import RigModel


def model_of(rig: Rig, dataset: SeriesDataset) -> RigModel:
    """Return the nominal model of ``rig`` for the recordings of ``dataset``, with the channels that were recorded.

    ValueError where they do not fit together.
    """
    check_fits(rig, dataset)
    channels = {one.name: rig.channels[one.name] for one in dataset.channels}
    model = RigModel(replace(rig, channels=channels), dataset.recordings)
    _check_own_names(model)
    return model


def _check_own_names(model: RigModel) -> None:
    """Raise ValueError if a suspect or gene of the rig has the name of one that is added: a fault, or a law of a port.

    Which names these are depends on the channels that were recorded.
    """
    genes = [*model.rig.genes, *model.rig.recording_genes]
    for what, names in (
        ("suspect", [one.name for one in model.suspects]),
        ("gene", [gene.name for gene in (*genes, *(gene for one in model.suspects for gene in one.genes))]),
    ):
        twice = [name for name, times in Counter(names).items() if times > 1]
        if twice:
            raise ValueError(
                f"rig {model.rig.name!r} has a {what} {twice[0]!r}, but faults of the channels and inputs and laws at "
                "the ports are added with names of that form; rename yours"
            )


def check_fits(rig: Rig, dataset: SeriesDataset) -> None:
    """Raise ValueError if channels, inputs, settings or units of ``dataset`` are not those of ``rig``."""
    for what, wanted, stated in (
        ("channel", rig.channels, {one.name: one.unit for one in dataset.channels}),
        ("input", rig.inputs, {one.name: one.unit for one in dataset.inputs}),
        ("setting", rig.settings, {one.name: one.unit for one in dataset.settings}),
    ):
        for name, unit in stated.items():
            if what == "channel" and name not in wanted:
                raise ValueError(
                    f"dataset {dataset.name!r} has a channel {name!r}, which rig {rig.name!r} does not simulate; it "
                    f"has {', '.join(wanted)}: remove the channel, or simulate it"
                )
            if name in wanted and unit != wanted[name]:
                raise ValueError(
                    f"{what} {name!r} is in {unit!r} in dataset {dataset.name!r}, but in {wanted[name]!r} in rig "
                    f"{rig.name!r}; convert one of them"
                )
        missing = [name for name in wanted if name not in stated]
        if missing and what != "channel":
            raise ValueError(f"rig {rig.name!r} needs the {what} {missing[0]!r}, but dataset {dataset.name!r} has none")
    own = [gene.name for gene in rig.recording_genes]
    for one in dataset.recordings:
        for name in one.estimates:
            if name not in own:
                have = ", ".join(own) or "none"
                raise ValueError(
                    f"recording {one.name!r} has an estimate of {name!r}, but the genes of one recording of rig "
                    f"{rig.name!r} are: {have}; correct the name"
                )
