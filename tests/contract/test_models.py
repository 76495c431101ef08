"""Every simulation model keeps the protocol that calibration and diagnosis rely on."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from tests.sim.effects.rigs import AnyModel, Array, bare, recordings

KINDS = ("wing", "vehicle")
BATCH = 11  # more than one group of lanes


def genomes(model: AnyModel) -> Array:
    """Different individuals [B, G] near the nominal one."""
    nominal = np.array([gene.nominal for gene in model.genes])
    return np.asarray(nominal * np.random.default_rng(3).uniform(0.95, 1.05, (BATCH, len(nominal))))


@pytest.mark.parametrize("kind", KINDS)
def test_searched_genes_are_genes_with_their_nominal_value_within_bounds(kind: str) -> None:
    model = bare(kind)
    names = [gene.name for gene in model.genes]
    assert len(set(names)) == len(names)
    assert set(model.searched) <= set(names)
    for gene in model.genes:
        gene.check(gene.nominal)


@pytest.mark.parametrize("kind", KINDS)
def test_observes_the_channels_of_the_recording_for_every_individual(kind: str) -> None:
    model, recording = bare(kind), recordings(kind)["air"]
    found = model.observe(genomes(model), recording)
    assert found.channels.shape == (BATCH, *recording.values.shape)
    assert len(found.reasons) == BATCH
    for channels, reason in zip(found.channels, found.reasons, strict=True):
        assert np.isfinite(channels).all() if reason is None else np.isnan(channels).all()


@pytest.mark.parametrize("kind", KINDS)
def test_an_individual_alone_has_the_same_bits_as_in_a_batch(kind: str) -> None:
    model, recording, batch = bare(kind), recordings(kind)["air"], genomes(bare(kind))
    whole = model.observe(batch, recording).channels
    for k in (0, BATCH - 1):
        assert model.observe(batch[k][None], recording).channels[0].tobytes() == whole[k].tobytes()


@pytest.mark.parametrize("kind", KINDS)
def test_a_pickled_model_gives_the_same_bits(kind: str) -> None:
    """Workers get their models so."""
    model, recording = bare(kind).with_effects("scale_error"), recordings(kind)["air"]
    batch = np.hstack([genomes(bare(kind)), np.full((BATCH, 1), 0.01)])
    copy = pickle.loads(pickle.dumps(model))  # noqa: S301
    assert copy == model
    assert (
        copy.observe(batch[:1], recording).channels.tobytes() == model.observe(batch[:1], recording).channels.tobytes()
    )
