"""The model of a user's rig: shapes, genes of a recording, added effects, failures as reasons, other processes."""

from __future__ import annotations

import pickle
import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from tests.rigs.oscillator import GENES, RIG, START, blank
from tests.rigs.oscillator import simulate as oscillator
from wingfit.calibration.problem import Problem, base_genome
from wingfit.records import Channel, Gene, Quantity, Series, SeriesDataset
from wingfit.records.array_types import Array
from wingfit.rigs.dataset_model import model_of
from wingfit.rigs.rig_model import RigModel
from wingfit.rigs.run import Run, SimulationError
from wingfit.rigs.suspect import Suspect
from wingfit.workers import make_evaluator

ONE, TWO = blank("one"), blank("two", samples=90, estimates={"start": 0.05})


def model(simulate: object = oscillator) -> RigModel:
    return RigModel(replace(RIG, simulate=simulate), (ONE, TWO))  # type: ignore[arg-type]


def nominal(of: RigModel) -> Array:
    return np.array([gene.nominal for gene in of.genes])


def test_genes_are_those_of_the_rig_and_of_each_recording() -> None:
    names = [gene.name for gene in model().genes]
    assert names == ["stiffness", "damping", "start[one]", "speed[one]", "start[two]", "speed[two]"]
    estimates = {gene.name: gene.nominal for gene in model().genes}
    assert estimates["start[one]"] == START[0].nominal
    assert estimates["start[two]"] == 0.05


def test_it_oscillates_as_the_closed_form() -> None:
    seen = model().observe(nominal(model()), ONE)
    k, c = (gene.nominal for gene in GENES)
    rate = np.sqrt(k - c**2 / 4)
    wave = np.cos(rate * ONE.times) + c / (2 * rate) * np.sin(rate * ONE.times)
    np.testing.assert_allclose(seen.channels[0, :, 0], 0.08 * np.exp(-c * ONE.times / 2) * wave, atol=1e-7)
    assert seen.reasons == (None,)


def test_shapes_and_the_order_of_the_recorded_channels() -> None:
    swapped = replace(ONE, quantities=ONE.quantities[::-1])
    genomes = np.tile(nominal(model()), (3, 1))
    genomes[1, 0] *= 1.1
    straight, other = (model().observe(genomes, one).channels for one in (ONE, swapped))
    assert straight.shape == (3, len(ONE.times), 2)
    np.testing.assert_array_equal(straight[..., ::-1], other)
    np.testing.assert_array_equal(straight[0], straight[2])
    assert np.abs(straight[0] - straight[1]).max() > 1e-3


def test_individuals_that_differ_in_other_recordings_are_simulated_once() -> None:
    calls = 0

    def counted(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        nonlocal calls
        calls += 1
        return oscillator(genes, run)

    genomes = np.tile(nominal(model()), (5, 1))
    genomes[:, 4] = np.linspace(0.0, 0.1, 5)  # start[two]
    model(counted).observe(genomes, ONE)
    assert calls == 1
    model(counted).observe(genomes, TWO)
    assert calls == 6


def test_every_suspect_is_off_in_a_model_that_has_it() -> None:
    straight = model().observe(nominal(model()), ONE).channels
    for suspect in model().suspects:
        extended = model().with_effects(suspect.name)
        np.testing.assert_array_equal(extended.observe(nominal(extended), ONE).channels, straight, err_msg=suspect.name)
        assert suspect.name not in [one.name for one in extended.suspects]


@pytest.mark.parametrize("name", [suspect.name for suspect in model().suspects if suspect.name != "clock"])
def test_every_suspect_changes_something_at_typical_size(name: str) -> None:
    extended = model().with_effects(name)
    suspect = next(one for one in model().suspects if one.name == name)
    genome = np.concatenate([nominal(model()), [suspect.typical[gene.name] for gene in suspect.genes]])
    recorded = replace(ONE, values=model().observe(nominal(model()), ONE).channels[0])
    extended = replace(extended, all_recordings=(recorded, TWO))
    suspect = next(one for one in replace(extended, effects=()).suspects if one.name == name)
    genome = np.concatenate([nominal(model()), [suspect.typical[gene.name] for gene in suspect.genes]])
    change = np.abs(extended.observe(genome, recorded).channels[0] - recorded.values).max(axis=0)
    assert (change > 1e-4 * np.ptp(recorded.values, axis=0)).any()


def test_an_unknown_suspect_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match=r"unknown suspect 'friktion'; rig 'oscillator' has drag, dry_friction\.slide"):
        model().with_effects("friktion")


def failing(message: str) -> object:
    def simulate(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        if genes["stiffness"] > 50.0:
            raise SimulationError(message)
        return oscillator(genes, run)

    return simulate


def test_a_failed_simulation_is_a_reason_and_spares_its_neighbours() -> None:
    genomes = np.tile(nominal(model()), (3, 1))
    genomes[1, 0] = 60.0
    seen = model(failing("the spring breaks")).observe(genomes, ONE)
    assert seen.reasons == (None, "the simulation fails: the spring breaks", None)
    assert np.isnan(seen.channels[1]).all()
    np.testing.assert_array_equal(seen.channels[0], model().observe(genomes[0], ONE).channels[0])


@pytest.mark.parametrize(
    ("returned", "reason"),
    [
        ({"position": np.zeros(160)}, "returned no channel 'speed', but position"),
        ({}, "returned no channel 'position', but nothing"),
        ({"position": np.zeros(3), "speed": np.zeros(160)}, r"'position' with shape \[3\]; it needs .* 160 times"),
        ({"position": np.full(160, np.nan), "speed": np.zeros(160)}, "the simulated position is not finite"),
        (
            {"position": np.ma.masked_less(np.zeros(160), 1), "speed": np.zeros(160)},
            "the simulated position is not finite",
        ),
    ],
)
def test_wrong_results_are_named(returned: dict[str, Array], reason: str) -> None:
    found = model(lambda _genes, _run: returned).observe(nominal(model()), ONE).reasons[0]
    assert found is not None
    assert re.search(reason, found)


def test_a_mistake_in_the_users_code_is_not_hidden() -> None:
    with pytest.raises(KeyError, match="stifness"):
        model(lambda genes, _: {"position": genes["stifness"]}).observe(nominal(model()), ONE)


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (None, "simulate returned NoneType; it must return a dict"),
        ([np.zeros(160)], "simulate returned list"),
        ({"position": np.zeros(160) + 1j, "speed": np.zeros(160)}, "complex values of 'position'"),
    ],
)
def test_no_mapping_of_real_values_is_refused(returned: object, message: str) -> None:
    with pytest.raises(TypeError, match=message):
        model(lambda _genes, _run: returned).observe(nominal(model()), ONE)


def test_a_simulation_cannot_change_the_recording() -> None:
    def simulate(_: Mapping[str, float], run: Run) -> dict[str, Array]:
        run.times[:] = 0.0
        for samples in run.inputs.values():
            samples[:] = 0.0
        return {"position": run.times, "speed": run.times}

    before = ONE.times.copy(), {name: one.copy() for name, one in ONE.inputs.items()}
    model(simulate).observe(nominal(model()), ONE)
    np.testing.assert_array_equal(ONE.times, before[0])
    for name, one in before[1].items():
        np.testing.assert_array_equal(ONE.inputs[name], one)


def test_a_suspect_that_is_called_like_a_fault_is_refused() -> None:
    own = Suspect("gain.position", genes=(Gene("own.size", "1", 0.0, -1.0, 1.0),))
    channels = tuple(Channel(one.name, one.unit) for one in ONE.quantities)
    one = replace(blank("one"), quantities=channels)
    dataset = SeriesDataset(
        "named twice",
        RIG.name,
        (one,),
        channels,
        tuple(Quantity(name, unit) for name, unit in RIG.inputs.items()),
        tuple(Quantity(name, unit) for name, unit in RIG.settings.items()),
    )
    model_of(RIG, dataset)
    with pytest.raises(ValueError, match=r"suspect 'gain\.position'.*rename yours"):
        model_of(replace(RIG, suspects=(*RIG.suspects, own)), dataset)


def test_a_missing_setting_is_a_reason() -> None:
    def simulate(_: Mapping[str, float], run: Run) -> dict[str, Array]:
        return {"position": run.times * run.setting("weight"), "speed": run.times}

    reason = model(simulate).observe(nominal(model()), ONE).reasons[0]
    assert reason == "the simulation fails: recording 'one' states no setting 'weight'; it has mass"


def test_a_short_recording_is_simulated() -> None:
    single = Series("one", np.zeros(1), (Channel("position", "m"),), np.zeros((1, 1)))
    assert model().observe(nominal(model()), single).channels.shape == (1, 1, 1)


@pytest.mark.parametrize("workers", [1, 2])
def test_processes_give_the_same_bits(workers: int) -> None:
    extended = model().with_effects("drag", "hysteresis.slide", "delay.position")
    recorded = [replace(one, values=model().observe(nominal(model()), one).channels[0]) for one in (ONE, TWO)]
    extended = replace(extended, all_recordings=tuple(recorded))
    free = tuple(gene.name for gene in extended.genes)
    problem = Problem(extended, tuple(recorded), free, base_genome(extended))
    rng = np.random.default_rng(3)
    values = np.array([[gene.from_unit(u) for gene, u in zip(extended.genes, row, strict=True)]
                       for row in rng.uniform(0.4, 0.6, (11, len(free)))])  # fmt: skip
    here = make_evaluator("in_process").evaluate(problem, values, residuals=True)
    there = make_evaluator("processes", workers)
    try:
        found = there.evaluate(problem, values, residuals=True)
    finally:
        there.close()
    for one, other in zip(here.per_recording, found.per_recording, strict=True):
        np.testing.assert_array_equal(one.squares, other.squares)
        np.testing.assert_array_equal(one.residuals, other.residuals)


def test_it_is_pickled_whole() -> None:
    again = pickle.loads(pickle.dumps(model()))  # noqa: S301
    np.testing.assert_array_equal(
        again.observe(nominal(model()), ONE).channels, model().observe(nominal(model()), ONE).channels
    )
