"""The settings of a plan, with their limits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields

from wingfit.calibration.spec import CalibrationSpec
from wingfit.records.dataset import AnyKind
from wingfit.records.name_lists import refuse_no_mapping, refuse_text

WHOLE = {"beats": (1, 100_000), "frames": (4, 100_000), "markers": (1, 10_000), "add": (0, 20)}
REAL = {
    "noise_mm": (1e-6, 1e3, "mm"),
    "noise_mn": (1e-6, 1e6, "mN"),
    "correlation": (0.0, 0.99, ""),
    "scatter_percent": (0.0, 100.0, "%"),
    "zero_mn": (0.0, 1e6, "mN"),
    "power": (0.5, 0.999, ""),
    "target_percent": (0.01, 100.0, "%"),
}
KINDS: dict[str, tuple[AnyKind, str]] = {
    "noise_mm": ("tracks", "marker tracks of a wing"),
    "markers": ("tracks", "marker tracks of a wing"),
    "noise_mn": ("forces", "forces of a vehicle"),
    "scatter_percent": ("forces", "forces of a vehicle"),
    "zero_mn": ("forces", "forces of a vehicle"),
}


@dataclass(frozen=True)
class PlanSpec:
    """Settings of a plan; None: as recorded or, before the first recording, a stated default.

    Attributes:
        calibration: model and genes, as for a calibration; its ``effects`` are part of the nominal model.
        effects: names of the effects that are compared; empty: all that apply to the rig. None: no effect.
        genome: values of genes, by name, where the plan is made: the result of a calibration. Others are nominal.
        noise_mm: standard deviation of each coordinate of a marker in one frame, mm.
        noise_mn: standard deviation of a sample of white noise of the force, mN.
        correlation: of the noise of successive frames or samples.
        scatter_percent: standard deviation of the force's amplitude from beat to beat, in per cent.
        zero_mn: standard deviation of the zero of a recording of forces, by drift since it was measured, mN.
        beats: recorded beats of each recording (tracks: apparent ones under a strobe); of another rig: repeats of each.
        frames: frames or samples per beat; not for other rigs.
        markers: number of markers, spread over the wing; None: all.
        add: recordings to propose.
        power: probability with which an effect is to be detected, or to be distinguished from another.
        target_percent: relative standard error of a gene, in per cent, that counts as identified.
    """

    calibration: CalibrationSpec = field(default_factory=CalibrationSpec)
    effects: tuple[str, ...] | None = ()
    genome: Mapping[str, float] = field(default_factory=dict)
    noise_mm: float | None = None
    noise_mn: float | None = None
    correlation: float | None = None
    scatter_percent: float | None = None
    zero_mn: float | None = None
    beats: int | None = None
    frames: int | None = None
    markers: int | None = None
    add: int = 3
    power: float = 0.9
    target_percent: float = 7.5

    def __post_init__(self) -> None:
        if self.effects is not None:
            refuse_text(self, "effects")
        refuse_no_mapping(self, "genome")
        for one in fields(self):
            value = getattr(self, one.name)
            if value is not None and one.name in WHOLE:
                _refuse_whole(one.name, value)
            elif value is not None and one.name in REAL:
                _refuse_real(one.name, value)

    def refuse_for(self, kind: AnyKind) -> None:
        """Raise ValueError for a setting that recordings of this ``kind`` do not have."""
        for name, (own, words) in KINDS.items():
            if getattr(self, name) is not None and own != kind:
                raise ValueError(f"{name} is a setting of {words}, and this plan is for {_WORDS[kind]}; leave it out")
        if kind == "series":
            for name in ("frames", "correlation"):
                if getattr(self, name) is not None:
                    raise ValueError(
                        f"{name} is {getattr(self, name)}, but the samples of another rig are those of its recordings; "
                        "leave it out"
                    )


_WORDS: dict[AnyKind, str] = {"tracks": "a wing", "forces": "a vehicle", "series": "another rig"}


def _refuse_whole(name: str, value: object) -> None:
    least, most = WHOLE[name]
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
        raise ValueError(f"{name} is {value!r}; give a whole number from {least} to {most}")


def _refuse_real(name: str, value: object) -> None:
    least, most, unit = REAL[name]
    number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if not number or not least <= float(value) <= most:  # type: ignore[arg-type]
        raise ValueError(f"{name} is {value!r}; give a number from {least:g} to {most:g}{f' {unit}' if unit else ''}")
