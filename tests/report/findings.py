"""Findings as a diagnosis of the two known rigs would give them, made by hand, with every number known."""

from __future__ import annotations

import math
from dataclasses import replace

from wingfit.diagnosis.advice.advised import Advice, AdvisedCondition
from wingfit.diagnosis.finding import (
    Exponent,
    Finding,
    Floors,
    FreeLaw,
    GeneValue,
    Hypothesis,
    Interval,
    MarkerMisfit,
    MissingLoad,
    Overlay,
    PhaseMap,
    Proof,
    RecordingMisfit,
    Table,
    Term,
    Verdict,
    Where,
)

SPAN_M, CHORD_M = 0.5, 0.21
LEADING = ((-0.06, 0.0), (-0.055, 0.15), (-0.03, 0.33), (0.0, 0.46), (0.04, 0.5))
TRAILING = ((0.07, 0.49), (0.10, 0.4), (0.12, 0.25), (0.15, 0.12), (0.15, 0.0))
BOTH = ("hinge_offset", "drive_harmonics")
VACUUM = AdvisedCondition(5.0, 14.0, 10.0, 0.0, 0.0)
OPEN = ("hinge_offset", "stroke_amplitude")
WEAK = ("added_mass", "tip_loss", "dynamic_stall", "wake_capture", "induced_inflow", "plate_drag")
NAMES = ("adequate", "named", "partly named", "ambiguous", "unnamed", "measurement fault")


def around(value: float, half: float) -> Interval:
    return Interval(value, value - half, value + half)


def bump(phase: float, centre: float, width: float) -> float:
    """A smooth bump over the beat that goes round its end."""
    return math.exp((math.cos(2 * math.pi * (phase - centre)) - 1) / (2 * math.pi * width) ** 2 * 2)


def probabilities(verdict: Verdict) -> dict[str, float]:
    return {name: 0.964 if name == verdict else 0.009 for name in NAMES}


def hypothesis(
    effects: tuple[str, ...],
    title: str,
    family: str,
    probability: float,
    explained: float,
    *,
    predicted: float | None = None,
    refitted: bool = True,
) -> Hypothesis:
    return Hypothesis(
        effects,
        title,
        family,
        f"Source of {title.lower()} (1935), Eq. 3" if effects else "",
        f"what {title.lower()} looks like in a recording" if effects else "",
        probability,
        420.5 * explained if effects else 0.0,
        1310.0 * explained,
        2 * len(effects),
        explained,
        predicted,
        math.sqrt(0.0008**2 + (1 - max(explained, 0.0)) * 0.0041**2),
        refitted,
    )


def marker(k: int) -> MarkerMisfit:
    """Marker ``k`` of 49: seven rows along the span, closer to each other at the tip, seven along the chord."""
    i, j = divmod(k, 7)
    span, chord = 0.06 + 0.9 * (i / 6) ** 0.75, 0.08 + 0.84 * j / 6
    lead = -0.06 + 0.08 * span**2
    size = 0.0061 * span**2 * (0.7 + 0.3 * chord)
    tilt = 0.35 * chord
    norm = math.hypot(0.1, tilt, 1.0)
    return MarkerMisfit(
        f"m{k + 1}",
        span,
        chord,
        lead + chord * (0.19 - 0.11 * span),
        span * SPAN_M,
        size,
        0.06 * size + 0.00012 * ((k * 7) % 5),
        0.12 + 0.03 * chord,
        (0.1 / norm, -tilt / norm, 1.0 / norm),
    )


def misfit_map(bands: int, columns: int, centre: float) -> PhaseMap:
    spans = tuple((i + 0.5) / bands for i in range(bands))
    phase = tuple((j + 0.5) / columns for j in range(columns))
    noise = 0.0008

    def row(span: float, size: float) -> tuple[float, ...]:
        return tuple(math.hypot(noise, size * span**2 * (0.15 + bump(p, centre, 0.1))) for p in phase)

    before, after = (tuple(row(s, size) for s in spans) for size in (0.008, 0.0006))
    return PhaseMap(spans, phase, before, after, noise)


def times(table: Table, factor: float) -> Table:
    return tuple(tuple(factor * v for v in row) for row in table)


def load(recording: str, stations: int, columns: int, size: float) -> MissingLoad:
    spans = tuple((i + 0.5) / stations for i in range(stations))
    phase = tuple((j + 0.5) / columns for j in range(columns))
    values = tuple(tuple(size * s * (bump(p, 0.12, 0.09) - 0.6 * bump(p, 0.6, 0.12)) for p in phase) for s in spans)
    errors = tuple(tuple(size * (0.08 + 0.15 * (1 - s)) for _ in phase) for s in spans)
    return MissingLoad(recording, spans, phase, values, errors, "N/m")


def recording(k: int, *, held_out: bool, forces: bool = False) -> RecordingMisfit:
    before = 0.0034 + 0.0004 * (k % 7)
    after = 0.00083 + 0.00002 * (k % 4)
    scale = 10.0 if forces else 1.0
    name = f"test-{k + 1}" if forces else f"{'vacuum' if k % 2 else 'tunnel'}-{2 + k % 3}hz-{k + 1}"
    return RecordingMisfit(
        name,
        held_out,
        2.0 + k % 3 + 0.5 * (k % 2),
        7.0 * (k % 3),
        10.0 if k % 2 else 1013.25,
        0.0 if k % 2 else 5.0,
        around(scale * before, scale * 0.0004),
        around(scale * after, scale * 0.00006),
        scale * 0.00081,
    )


def overlay(recording_name: str, channel: str, *, held_out: bool, size: float) -> Overlay:
    phase = tuple((j + 0.5) / 30 for j in range(30))
    after = tuple(size * math.sin(2 * math.pi * p) for p in phase)
    before = tuple(a + 0.22 * size * bump(p, 0.12, 0.1) for a, p in zip(after, phase, strict=True))
    recorded = tuple(a + 0.015 * size * math.sin(37.0 * j) for j, a in enumerate(after))
    return Overlay(recording_name, channel, held_out, phase, recorded, before, after)


def wing_finding() -> Finding:
    """The Robird's wing: a displaced hinge and a wrong drive."""
    hypotheses = (
        hypothesis(BOTH, "Displaced hinge and drive harmonics", "actuation", 0.93, 0.973, predicted=0.961),
        hypothesis(("hinge_offset",), "Displaced hinge", "actuation", 0.031, 0.71, predicted=0.68),
        hypothesis(("camera_rotation",), "Rotated camera frame", "measurement", 0.002, 0.32, predicted=-0.11),
        hypothesis((), "Nominal model", "", 0.0004, 0.0),
        hypothesis(("drive_harmonics",), "Harmonics of the drive", "actuation", 0.0001, 0.29, predicted=0.22),
        *(
            hypothesis((name,), name.replace("_", " "), "aerodynamics", 1e-6, 0.12 - 0.008 * k, refitted=False)
            for k, name in enumerate(WEAK)
        ),
    )
    genes = (
        GeneValue("hinge_offset.y", "m", "offset of the hinge along the span", Interval(0.0123, 0.0117, 0.0129), 0.0),
        GeneValue("hinge_offset.z", "m", "offset of the hinge upwards", Interval(-0.0008, -0.0017, 0.0001), 0.0),
        GeneValue("drive_harmonics.sine_2", "rad", "second harmonic of the drive", Interval(0.062, 0.058, None), 0.0),
        GeneValue("E_f", "Pa", "elastic modulus of the foam", Interval(5.04e6, 4.71e6, 5.37e6)),
        GeneValue("L_a", "1", "slope of the lift coefficient", Interval(2.31, None, None)),
    )
    conditions = (
        (0, False),
        (1, False),
        (2, False),
        (3, False),
        (4, True),
        (5, True),
        (6, False),
        (7, False),
        (8, True),
    )
    return Finding(
        dataset="falcon-1",
        kind="tracks",
        unit="m",
        model="multi-body wing, 24 bodies (6 x 4), preset Robird",
        verdict="named",
        summary="The actuation is not what the model says: the hinge lies 12.3 mm further out than drawn, and the "
        "drive has a second harmonic of 3.55°. With both put in, the misfit on held-out recordings falls to the floor.",
        probabilities=probabilities("named"),
        named=BOTH,
        added_effects=BOTH,
        strength=5.12,
        floors=Floors(0.0008, 0.42, 0.00021, "48 bodies (12 x 4)", 0.00006, 0.00083),
        hypotheses=hypotheses,
        indistinguishable=(("hinge_offset", "drive_harmonics"), ("stroke_amplitude",)),
        where=Where(
            "Outer 30 % of the span, during the first third of the downstroke, along the flap normal; grows with the "
            "flap frequency squared.",
            Interval(0.85, 0.7, 1.0),
            None,
            Interval(0.02, 0.93, 1.11),
            "flap normal",
            (0.08, 0.61, 0.22, 0.06, 0.03),
            (
                Exponent("flap frequency", around(1.94, 0.21), 2.0, 5.0, "Hz"),
                Exponent("air density", around(0.04, 0.3), 0.012, 1.2, "kg/m³"),
                Exponent("airspeed", Interval(0.6, None, 1.9), 1.0, 11.0, "m/s"),
            ),
        ),
        markers=tuple(marker(k) for k in range(49)),
        phase_map=misfit_map(6, 30, 0.12),
        missing=(load("tunnel-4hz-3", 12, 30, 1.8), load("vacuum-3hz-2", 12, 30, 0.7)),
        recordings=tuple(recording(k, held_out=held) for k, held in conditions),
        proof=Proof(around(4.43, 0.32), around(1.04, 0.05), 1.0, True, "At frequencies the fit has not seen."),
        overlays=tuple(
            overlay(f"tunnel-{k}hz", f"m{40 + k} {axis}", held_out=k > 3, size=0.12)
            for k in range(2, 5)
            for axis in ("z", "x")
        ),
        genes=genes,
        law=None,
        advice=(
            Advice(
                "Record at 5 Hz in vacuum, with a lag of 14°.",
                6.3,
                0.97,
                OPEN,
                AdvisedCondition(5.0, 14.0, 10.0, 0.0, 0.0),
            ),
            Advice("Record at 5 Hz in still air.", 3.2, 0.81, OPEN, AdvisedCondition(5.0, 0.0, 1013.25, 0.0, 0.0)),
        ),
        outline=(*LEADING, *TRAILING),
        remarks=("Noise rests on 6 beats only.", "Marker m17 was seen in two recordings only."),
        seconds=412.5,
        evaluations=18240,
        versions={"wingfit": "0.1.0", "commit": "0123abc", "numpy": "2.1.0"},
    )


def force_finding() -> Finding:
    """The DelFly: clap-and-peel left out."""
    wing = wing_finding()
    one = misfit_map(1, 60, 0.17)
    phase_map = PhaseMap((0.0,), one.phase, times(one.before, 20.0), times(one.after, 20.0), 0.016)
    flat = load("test-4", 1, 60, 0.35)
    return replace(
        wing,
        dataset="delfly-2",
        kind="forces",
        unit="N",
        model="blade elements, preset Berman and Wang, 40 strips",
        summary="Wing-wing interaction while the wings part (t* < 0.37): clap-and-peel.",
        named=("clap_and_peel",),
        strength=8.4,
        floors=Floors(0.0016, 0.6, None, "", 0.00001, 0.0016),
        hypotheses=(
            hypothesis(("clap_and_peel",), "Clap-and-peel", "aerodynamics", 0.97, 0.992, predicted=0.988),
            hypothesis(("wake_capture",), "Wake capture", "aerodynamics", 0.01, 0.55, predicted=0.31),
            hypothesis((), "Nominal model", "", 0.0, 0.0),
        ),
        indistinguishable=(),
        where=Where(
            "In the first 0.37 of the beat, along x.", None, None, Interval(0.19, 0.04, 0.37), "x", (0.3, 0.4, 0.2, 0.1)
        ),
        markers=(
            MarkerMisfit("X", None, None, None, None, 0.031, 0.0011, 0.17, (1.0, 0.0, 0.0)),
            MarkerMisfit("Z", None, None, None, None, 0.012, 0.0009, 0.2, (0.0, 0.0, 1.0)),
        ),
        phase_map=phase_map,
        missing=(replace(flat, unit="N"),),
        recordings=tuple(recording(k, held_out=k > 5, forces=True) for k in range(8)),
        overlays=tuple(overlay(f"test-{k}", axis, held_out=k > 6, size=0.3) for k in (4, 7) for axis in ("x", "z")),
        genes=(GeneValue("clap_and_peel.C_F", "1", "peel coefficient", Interval(1.58, 1.52, 1.64), 0.0),),
        advice=(),
        outline=(),
    )


def with_verdict(finding: Finding, verdict: Verdict) -> Finding:
    """The same with another verdict and what goes with it."""
    changed = replace(finding, verdict=verdict, probabilities=probabilities(verdict), summary=f"It is {verdict}.")
    if verdict == "adequate":
        changed = replace(changed, named=(), added_effects=())
        return replace(changed, where=None, missing=(), proof=None, advice=(), strength=1.02)
    if verdict == "unnamed":
        terms = (
            Term("rho V^2 c", around(0.31, 0.05), "1"),
            Term("rho c^2 dV/dt", Interval(-0.08, None, -0.02), "N s^2/m^4"),
        )
        return replace(changed, named=(), law=FreeLaw("A load that grows with the square of speed.", terms, 0.87))
    return (
        replace(changed, named=("camera_rotation",), added_effects=("camera_rotation",))
        if verdict == "measurement fault"
        else changed
    )


def bare(finding: Finding) -> Finding:
    """The same with nothing that may be left out."""
    return replace(
        finding,
        named=(),
        hypotheses=(),
        indistinguishable=(),
        where=None,
        markers=(),
        phase_map=None,
        missing=(),
        recordings=(),
        proof=None,
        overlays=(),
        genes=(),
        law=None,
        advice=(),
        outline=(),
        remarks=(),
        versions={},
    )
