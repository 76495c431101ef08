"""Remarks on the calibration of a rig: misfit beyond noise, unknown noise, genes at bounds, an unfinished search."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from wingfit.calibration.effects import added_effects, switched_off
from wingfit.calibration.estimates import likelihood
from wingfit.calibration.preparation import Prepared
from wingfit.calibration.result import ADEQUATE
from wingfit.calibration.series.misfits import Compared
from wingfit.calibration.series.own_genes import OwnGenes
from wingfit.records import Genome, SeriesDataset


def not_simulated(everywhere: Sequence[Compared]) -> tuple[str, ...]:
    """Return remarks on recordings that cannot be simulated with the nominal or the best genome."""
    return tuple(
        f"recording {one.recording.name!r} cannot be simulated with the {which} genome: {reason}"
        for one in everywhere
        for which, reason in zip(("nominal", "best"), one.reasons, strict=True)
        if reason
    )


def beyond_noise(fitted: Sequence[Compared]) -> tuple[str, ...]:
    """Return a remark that names the channels whose residual with the best genome noise does not explain.

    Channels of unknown noise are not judged.
    """
    found = ", ".join(_beyond(fitted))
    if not found:
        return ()
    return (
        f"the residual of the best genome is beyond the noise: {found}. Either the search was cut short, or the "
        "simulation misses physics: run 'wingfit diagnose' with this dataset and rig to find what is missing. Standard "
        f"errors assume at most {ADEQUATE:g} times the noise, so no gene counts as identifiable",
    )


def _beyond(fitted: Sequence[Compared]) -> Iterator[str]:
    """Yield name, root mean square and ratio to the noise of each channel whose residual noise does not explain."""
    simulated = [one for one in fitted if not one.reasons[1]]
    for k, channel in enumerate(simulated[0].recording.quantities if simulated else ()):
        some = [one for one in simulated if one.samples[k] and np.isfinite(one.noise.standard_deviation[k])]
        if not some:
            continue
        count = [int(one.samples[k]) for one in some]
        square = sum(float(one.squares(1)[k]) for one in some) / sum(count)
        noise = float(np.average([float(one.noise.standard_deviation[k]) ** 2 for one in some], weights=count))
        if square > float(np.average([_limit(one, k) for one in some], weights=count)):
            unit = "" if channel.unit == "1" else f" {channel.unit}"
            yield f"{channel.name} {np.sqrt(square):.3g}{unit} ({np.sqrt(square / noise):.2g} times)"


def _limit(one: Compared, k: int) -> float:
    """Return the largest mean square of channel number ``k`` that noise, or its accepted error, explains."""
    allowed = one.recording.quantities[k].accepted_error or 0.0
    wide = 1.0 + 2.0 * float(one.noise.relative_error[k])  # two standard errors of the variance
    return ADEQUATE**2 * wide * float(one.noise.standard_deviation[k]) ** 2 + allowed**2


def unknown_noise(fitted: Sequence[Compared]) -> tuple[str, ...]:
    """Return a remark that names the channels whose noise is not known."""
    names = {
        channel.name: None
        for one in fitted
        for k, channel in enumerate(one.recording.quantities)
        if one.samples[k] and not np.isfinite(one.noise.standard_deviation[k])
    }
    if not names:
        return ()
    what = "channels" if len(names) > 1 else "channel"
    return (
        f"the noise of {what} {', '.join(names)} is not known, so that nothing shows whether the residual is noise or "
        "missing physics: state standard_deviation, or record the same experiment twice",
    )


def unfinished(moved: Mapping[str, float], limit: float) -> tuple[str, ...]:
    """Return a remark if one more iteration moves a gene too far; ``moved``, ``limit``: in standard errors."""
    name = max(moved, key=lambda one: moved[one])
    if not moved[name] > limit:
        return ()
    return (
        f"the search ended before the minimum: one more Gauss-Newton iteration moves {name} by {moved[name]:.2g} "
        "standard errors; use method 'auto', finish, or more generations",
    )


def at_bounds(ready: Prepared, best: Genome) -> tuple[str, ...]:
    """Return remarks on effects that are switched off in ``best``, and on genes at a bound."""
    free, off, found = ready.searched, set[str](), list[str]()
    for effect in added_effects(ready.model, free):
        if all(best[name] == 0.0 for name in effect.sizes):
            off.update(effect.genes)
            found.append(switched_off(effect, free))
    genes = [gene for gene in best.genes if gene.name in free and gene.name not in off]
    return (*found, *likelihood.at_bounds(genes, best.as_dict()))


def own_genes(own: OwnGenes, dataset: SeriesDataset) -> tuple[str, ...]:
    """Return a remark that names the genes that were fitted to a recording alone, for the comparison with it."""
    names = [name for recording in dataset.recordings for name in own.of(recording)]
    if not names:
        return ()
    return (
        f"{', '.join(names)}: fitted to the recording alone to which they belong, which is not fitted otherwise; its "
        "misfits show how well all other genes predict it",
    )
