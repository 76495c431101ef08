"""Simulated tracks of a wing with a load or drive error unknown to its model, as cases for load inference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from wingfit.diagnosis.location.missing_load import Case, whitened
from wingfit.records import Condition, Recording
from wingfit.sim.effects.probe import Probe
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, tunnel, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.loads import crossing
from wingfit.sim.wing.probing import Probed, probed

Array = npt.NDArray[np.float64]

NOISE, LAG1, FRAMES = 5e-4, 0.6, 62
CONDITIONS = (vacuum(10.0, 0.05, 3.0), tunnel(0.05, 3.0, 6.0), vacuum(1000.0, 0.12, 4.0), tunnel(0.0, 2.0, 3.5))
_STEP = 0.01  # unit coordinates


def model(division: str) -> FlexibleWing:
    return FlexibleWing(robird_wing(), division, numerics=Numerics(steps=96, periodic=2e-6, max_beats=60))


def nominal(wing: FlexibleWing) -> Array:
    return np.array([gene.nominal for gene in wing.genes])


def gaussian_load(
    span: Array, phase: Array, place: float, when: float, width: float = 0.06, lasting: float = 0.05
) -> Array:
    """[span, phase] a Gaussian of height one at a location and a phase."""
    during = (phase - when + 0.5) % 1.0 - 0.5
    return np.asarray(np.exp(-0.5 * ((span[:, None] - place) / width) ** 2 - 0.5 * (during / lasting) ** 2))


def chord_at(wing: FlexibleWing, span: npt.ArrayLike) -> Array:
    """Chord (m) at ``span`` (0 to 1)."""
    edges = wing.structure.planform.strips(wing.structure.division)
    return wing.structure.planform.chord(edges[0] + np.asarray(span, float) * (edges[-1] - edges[0]))


def with_load(
    wing: FlexibleWing, condition: Condition, place: float, when: float, size: float, part: float = 0.5
) -> Array:
    """Genome of ``wing`` (with a fine probe) with a load of ``size`` (N/m), ``when`` (beats) after the crossing.

    At ``part`` of the chord, if the probe has moments.
    """
    probe, blank, genome = wing.probe, blank_recording(wing.wing, condition), nominal(wing)
    assert probe is not None
    phase = np.arange(256) / 256
    series = np.linalg.pinv(probe.terms(phase))
    for _ in range(2):  # the load moves the crossing slightly
        start = crossing(wing, blank, wing.beat(genome, blank).tracks)
        field = size * gaussian_load(np.array(probe.stations), phase, place, when + start)
        forces = field @ series.T
        lever = (0.5 - part) * chord_at(wing, probe.stations)[:, None]
        genome[-probe.size :] = np.concatenate([forces, lever * forces]).ravel()[: probe.size]
    return genome


def with_drive_error(
    wing: FlexibleWing, condition: Condition, when: float, turns_deg: Sequence[float], lasting: float = 0.05
) -> Array:
    """Genome of ``wing`` (with a driving probe) whose rods are turned further, ``when`` beats after the crossing."""
    probe, blank, genome = wing.probe, blank_recording(wing.wing, condition), nominal(wing)
    assert probe is not None
    phase = np.arange(256) / 256
    for _ in range(2):  # the error moves the crossing slightly
        start = crossing(wing, blank, wing.beat(genome, blank).tracks)
        during = (phase - when - start + 0.5) % 1.0 - 0.5
        series = np.linalg.pinv(probe.terms(phase)) @ np.exp(-0.5 * (during / lasting) ** 2)
        genome[-2 * len(series) :] = np.kron(turns_deg, series)
    return genome


def noise(shape: tuple[int, int], rng: np.random.Generator) -> Array:
    """[T, C] noise of standard deviation NOISE and lag-1 autocorrelation LAG1."""
    found = rng.standard_normal(shape)
    for t in range(1, len(found)):
        found[t] = LAG1 * found[t - 1] + np.sqrt(1 - LAG1**2) * found[t]
    return np.asarray(NOISE * found)


def recorded_tracks(wing: FlexibleWing, genome: Array, condition: Condition, rng: np.random.Generator) -> Recording:
    """Two apparent beats of 31 frames under a strobe, with noise and some gaps."""
    blank = blank_recording(wing.wing, condition, name=f"{condition.airspeed:g} m/s", frames=FRAMES)
    times = np.arange(FRAMES) * 30 / 31 / condition.flap_frequency
    tracks = wing.beat(genome, blank).tracks
    series = np.fft.rfft(tracks.reshape(len(tracks), -1), axis=0) / len(tracks)
    series[1:] *= 2
    turn = np.exp(2j * np.pi * condition.flap_frequency * times[:, None] * np.arange(len(series)))
    values = (turn @ series).real + noise((FRAMES, series.shape[1]), rng)
    values[rng.uniform(size=values.shape) < 0.02] = np.nan
    return replace(blank, times=times, values=values)


def sensitivities(wing: FlexibleWing, genome: Array, recording: Recording) -> tuple[Array, Array]:
    """Residuals [T, C] and their derivatives [T, C, G] with the genes in unit coordinates."""
    unit = np.array([float(gene.to_unit(value)) for gene, value in zip(wing.genes, genome, strict=True)])
    rows = [genome]
    for k, gene in enumerate(wing.genes):
        for sign in (1.0, -1.0):
            rows.append(genome.copy())
            rows[-1][k] = float(gene.from_unit(unit[k] + sign * _STEP))
    seen = wing.observe(np.array(rows), recording).channels
    return seen[0] - recording.values, np.moveaxis((seen[1::2] - seen[2::2]) / (2 * _STEP), 0, -1)


def of_samples(
    name: str, residuals: Array, memory: float, responses: Array, sensitivities: Array, crossing: float
) -> Case:
    """A whitened case of samples with noise of standard deviation NOISE and lag-1 autocorrelation ``memory``.

    ``residuals`` [T, C] are simulated minus recorded, NaN where missing; ``responses`` [T, C, P] to unit loads;
    ``sensitivities`` [T, C, F] to the genes.
    """
    seen = np.isfinite(residuals)
    both = np.concatenate([-residuals[..., None], np.nan_to_num(responses), sensitivities], axis=2) / NOISE
    white = np.concatenate(
        [whitened(both[seen[:, c], c], np.flatnonzero(seen[:, c]), memory) for c in range(residuals.shape[1])]
    )
    P = responses.shape[2]
    return Case(name, white[:, 0], white[:, 1 : 1 + P], white[:, 1 + P :], crossing)


def case(wing: FlexibleWing, recording: Recording, probe: Probe) -> tuple[Case, Probed]:
    """The case of ``recording`` with the nominal wing, and the responses."""
    genome = nominal(wing)
    answers = probed(wing, genome, recording, probe)
    residuals, slopes = sensitivities(wing, genome, recording)
    return of_samples(recording.name, residuals, LAG1, answers.responses, slopes, answers.crossing), answers
