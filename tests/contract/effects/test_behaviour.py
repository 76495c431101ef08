"""How every effect must behave in a simulation, on every rig that it applies to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from tests.sim.effects.rigs import AnyModel, Array, bare, recordings, rig_of
from wingfit.sim.effects.registry import EFFECTS, chosen
from wingfit.sim.model import Observation
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.wing.flexible_wing import FlexibleWing

KINDS = ("wing", "vehicle")
CASES = [(name, kind) for name, effect in EFFECTS.items() for kind in KINDS if effect.applies_to(rig_of(bare(kind)))]
INVISIBLE = {
    ("clock_offset", "wing"): "tracks are placed on the beat by what they show",
}
FEW = 3  # individuals of a trial: off, off elsewhere, typical
TOGETHER = [
    ("wing", ("compliant_drive", "stroke_amplitude")),
    ("wing", ("backlash", "viscoelastic", "rod_slip", "cubic_stiffness", "added_mass")),
    ("wing", ("compliant_drive", "stroke_bias", "lumped_mass", "induced_inflow", "dynamic_stall", "clap_and_peel")),
    ("vehicle", ("stroke_amplitude", "circulation_lag", "induced_inflow", "wake_capture")),
]
SEEN = {"wing": 2e-6, "vehicle": 2e-5}  # m, N: RMS of the change that a typical size makes at least


@dataclass(frozen=True)
class Trial:
    """Individuals [B, G] of a model with one effect, and what each is: off, typical, or an end of a bound."""

    model: AnyModel
    genomes: Array
    labels: tuple[str, ...]

    def row(self, label: str) -> int:
        return self.labels.index(label)


def own(model: AnyModel) -> Array:
    """Nominal values of the model's own genes."""
    return np.array([gene.nominal for gene in model.genes])


@cache
def trial(name: str, kind: str) -> Trial:
    """Off, off elsewhere, typical, half of it, each parameter at either end, and typical again in another lane."""
    effect, model = EFFECTS[name], bare(kind, name)
    genes = effect.genes(rig_of(model))
    nominal = {gene.name: gene.nominal for gene in genes}
    typical = effect.typical(rig_of(model))
    sizes = {f"{name}.{p.name}" for p in effect.size}
    rows = {
        "off": nominal,
        "off elsewhere": {g.name: nominal[g.name] if g.name in sizes else g.upper for g in genes},
        "typical": typical,
        "half": {key: value * (0.5 if key in sizes else 1.0) for key, value in typical.items()},
        **{f"{g.name} lower": typical | {g.name: g.lower} for g in genes},
        **{f"{g.name} upper": typical | {g.name: g.upper} for g in genes},
        "again": typical,
    }
    genomes = np.array([[*own(model), *(row[g.name] for g in genes)] for row in rows.values()])
    return Trial(model.with_effects(name), genomes, tuple(rows))


@cache
def observation(name: str, kind: str, where: str) -> Observation:
    """All individuals of the trial at once; in vacuum the first few."""
    tried = trial(name, kind)
    return tried.model.observe(tried.genomes[: None if where == "air" else FEW], recordings(kind)[where])


@cache
def without(name: str, kind: str, where: str) -> Array:
    """Channels [T, C] of the model that has never heard of the effect."""
    model = bare(kind, name)
    found: Array = model.observe(own(model)[None], recordings(kind)[where]).channels[0]
    return found


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_off_is_exactly_nothing(name: str, kind: str) -> None:
    """Whatever its other parameters are, and whoever else is in the batch."""
    tried = trial(name, kind)
    for where in recordings(kind):
        for label in ("off", "off elsewhere"):
            channels = observation(name, kind, where).channels[tried.row(label)]
            assert channels.tobytes() == without(name, kind, where).tobytes(), f"{label} in {where}"


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_an_individual_depends_on_nobody_else(name: str, kind: str) -> None:
    """Alone, in another lane, in a batch turned round: the same bits."""
    tried, recording = trial(name, kind), recordings(kind)["air"]
    whole = observation(name, kind, "air").channels
    turned = tried.model.observe(tried.genomes[::-1], recording).channels[::-1]
    assert whole.tobytes() == np.ascontiguousarray(turned).tobytes()
    assert whole[tried.row("typical")].tobytes() == whole[tried.row("again")].tobytes()
    for label in ("typical", "half"):
        alone = tried.model.observe(tried.genomes[tried.row(label)][None], recording).channels[0]
        assert alone.tobytes() == whole[tried.row(label)].tobytes()


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_a_typical_size_is_seen(name: str, kind: str) -> None:
    tried, changes = trial(name, kind), []
    for where in recordings(kind):
        found = observation(name, kind, where)
        row = tried.row("typical")
        assert found.reasons[row] is None, f"in {where}"
        changes.append(float(np.sqrt(np.mean((found.channels[row] - without(name, kind, where)) ** 2))))
    if (name, kind) in INVISIBLE:
        assert max(changes) < SEEN[kind]
    else:
        assert max(changes) > SEEN[kind]


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_ends_of_the_bounds_are_finite_or_say_why(name: str, kind: str) -> None:
    found = observation(name, kind, "air")
    for label, channels, reason in zip(trial(name, kind).labels, found.channels, found.reasons, strict=True):
        if reason is None:
            assert np.isfinite(channels).all(), label
        else:
            assert label.endswith(("lower", "upper")), f"{label}: {reason}"
            assert not EFFECTS[name].observe, f"{label}: no fault of a measurement stops a wing, but {reason}"
            assert np.isnan(channels).all(), label


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_a_faulty_recording_is_placed_on_the_beat_where_it_was_taken(name: str, kind: str) -> None:
    """Aligned by what the effect makes of the tracks, the model that has it is as it was; one without is elsewhere."""
    tried = trial(name, kind)
    rows = [tried.row("typical"), tried.row("off")]
    values = observation(name, kind, "air").channels[rows[0]]
    recording = replace(recordings(kind)["air"], values=values)
    found, other = tried.model.observe(tried.genomes[rows], recording).channels
    np.testing.assert_allclose(found, values, atol=1e-9)
    if (name, kind) not in INVISIBLE:
        assert np.sqrt(np.mean((other - values) ** 2)) > SEEN[kind]


@pytest.mark.parametrize("name", [name for name, kind in CASES if kind == "wing" and EFFECTS[name].observe])
def test_a_wing_that_fails_is_told_and_not_warned_of(name: str) -> None:
    tried = trial(name, "wing")
    wild = tried.genomes[[tried.row("typical")]].copy()
    wild[0, [gene.name for gene in tried.model.genes].index("L_a")] = 1e6
    found = tried.model.observe(wild, recordings("wing")["air"])
    assert found.reasons[0]
    assert np.isnan(found.channels).all()


@pytest.mark.parametrize(("kind", "names"), TOGETHER)
def test_effects_together_depend_on_nobody_else(kind: str, names: tuple[str, ...]) -> None:
    """Small and large sizes of all beside each other, and none is zero: alone, and in any order, the same bits."""
    model, recording = bare(kind).with_effects(*names), recordings(kind)["air"]
    rig, rng = rig_of(model), np.random.default_rng(6)
    genes = model.genes[len(own(bare(kind))) :]
    sizes = {f"{e.name}.{p.name}" for e in chosen(names, rig) for p in e.size}
    typical = {key: value for name in names for key, value in EFFECTS[name].typical(rig).items()}
    rows = [[*own(bare(kind)), *(typical[g.name] for g in genes)]]
    for _ in range(6):
        ends = [rng.choice([g.lower or 0.5 * typical[g.name], typical[g.name], g.upper]) for g in genes]
        rows.append(
            [*own(bare(kind)), *(e if g.name in sizes else typical[g.name] for g, e in zip(genes, ends, strict=True))]
        )
    batch = np.array(rows)
    whole = model.observe(batch, recording)
    assert any(reason is None for reason in whole.reasons)
    order = rng.permutation(len(batch))
    shuffled = model.observe(batch[order], recording).channels
    for k, row in enumerate(batch):
        assert model.observe(row[None], recording).channels[0].tobytes() == whole.channels[k].tobytes()
        assert shuffled[np.flatnonzero(order == k)[0]].tobytes() == whole.channels[k].tobytes()


@pytest.mark.parametrize("kind", KINDS)
def test_effects_combine_and_all_off_are_nothing(kind: str) -> None:
    """All at once: switched off they are nothing, at a tenth of what is typical they are finite.

    Together they ask for more steps than each alone, so those are left to the wing.
    """
    names = [name for name, where in CASES if where == kind]
    model = bare(kind)
    if isinstance(model, FlexibleWing):
        model = replace(model, numerics=Numerics())
    if not isinstance(model, FlexibleWing):
        names = [name for name in names if EFFECTS[name].fits(model.terms)]
    rig, both = rig_of(model), model.with_effects(*names)
    genes = both.genes[len(model.genes) :]
    sizes = {f"{e.name}.{p.name}" for e in chosen(names, rig) for p in e.size}
    typical = {key: value for name in names for key, value in EFFECTS[name].typical(rig).items()}
    small = [typical[g.name] * (0.1 if g.name in sizes else 1.0) for g in genes]
    batch = np.array([[*own(model), *values] for values in ([g.nominal for g in genes], small)])
    found = both.observe(batch, recordings(kind)["air"])
    assert found.channels[0].tobytes() == model.observe(own(model)[None], recordings(kind)["air"]).channels.tobytes()
    assert found.reasons == (None, None)
    assert np.isfinite(found.channels[1]).all()
