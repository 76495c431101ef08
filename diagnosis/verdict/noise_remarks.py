"""Remarks on the noise of the recordings: slow, uneven, or not noise at all."""

from __future__ import annotations

import numpy as np

from wingfit.diagnosis.evidence.fit import Fit
from wingfit.diagnosis.evidence.position_errors import PositionErrors, too_many
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.finding import amount
from wingfit.diagnosis.verdict.noise_doubt import UNEVEN, faint, noisier, quiet_noise
from wingfit.diagnosis.verdict.weigh_hypotheses import drifts
from wingfit.inference.noise.changes.drift import Drift
from wingfit.inference.noise.changes.modulation import Modulation, modulation_words
from wingfit.inference.noise.harmonic import still_markers
from wingfit.inference.noise.stated import Stated
from wingfit.records import FrameError
from wingfit.records.array_types import Array, Float
from wingfit.sim.filtering import sampling_rate

FINE = 12.0  # samples in a beat: then only the ninth harmonic and higher ones fold to three and below


def noise_remarks(data: WhitenedData, unit: str) -> tuple[str, ...]:
    """Return remarks on the noise of the recordings, and on what may be mistaken for it; ``unit``: "m" or "N"."""
    each = list(zip(data.recordings, data.beat_fits, strict=True))
    within_beats = [r.name for r, v in each if not v.between_beats and not (v.stated and v.stated.used)]
    remarks = [
        f"{one.name}: the recorded position of {', '.join(markers)} never changes; ignored: check the export of tracks"
        for one in data.beat_recordings
        if (markers := still_markers(one))
    ]
    if within_beats:
        remarks.append(
            f"{', '.join(within_beats)}: fewer than two beats in the order of the frames; noise is estimated only "
            "from the residual of the beat's harmonics, and slow noise may look like misfit: record longer"
        )
    on_changes = (*_drift_remarks(data, unit), *_modulation_remarks(data, unit), *_shared_remarks(data))
    remarks.extend(_coarse_remarks(data))
    return (*remarks, *_stated_remarks(data), *on_changes, *_uneven_noise_remarks(data, unit), *_faint_remarks(data))


def _coarse_remarks(data: WhitenedData) -> tuple[str, ...]:
    """Return a remark on forces with so few samples in a beat that higher harmonics may fold into the passed ones."""
    if data.kind != "forces":
        return ()
    each = ((one, sampling_rate(one) / one.condition.flap_frequency) for one in data.beat_recordings if one.low_pass)
    found = [f"{one.name} ({samples:.3g})" for one, samples in each if samples < FINE]
    remark = (
        f"there are few samples in a beat of {', '.join(found)}: what the forces contain beyond half the sampling "
        "rate appears at lower harmonics, unless it was filtered out before sampling, and then looks like missing "
        f"physics; record at least {FINE:g} samples in a beat, or use an anti-aliasing filter"
    )
    return (remark,) if found else ()


def _stated_remarks(data: WhitenedData) -> tuple[str, ...]:
    """Return remarks on recordings whose stated noise is not used, because it does not agree with what is seen."""
    each = zip(data.recordings, data.beat_fits, strict=True)
    wrong = [(one.name, fit.stated.ratio) for one, fit in each if fit.stated and not fit.stated.used]
    kinds = (
        ([one for one in wrong if one[1] > 1.0], "check the unit and that it is of single samples"),
        ([one for one in wrong if one[1] <= 1.0], "something else changes from beat to beat, or it is too small"),
    )
    unlike = [one.name for one, fit in zip(data.recordings, data.beat_fits, strict=True) if _is_unlike(fit.stated)]
    remark = (
        f"the stated correlations of the noise in {', '.join(unlike)} are not used: independent coordinates agree "
        "better with what differs between beats; check that they are in the axes of the wing: x with y, x with z, "
        "y with z"
    )
    sizes = (
        "the stated standard deviation of the noise is not used where it is far from the noise that is seen: "
        f"{', '.join(f'{ratio:.2g} times in {name}' for name, ratio in found)}; {cause}"
        for found, cause in kinds
        if found
    )
    return (*sizes, *((remark,) if unlike else ()))


def _is_unlike(stated: Stated | None) -> bool:
    return stated is not None and stated.correlated is False


def _drift_remarks(data: WhitenedData, unit: str) -> tuple[str, ...]:
    """Return a remark on recordings during which the beat changes slowly; empty if there are none."""
    found = [f"{name} ({drift.words(amount(drift.size, unit))})" for name, drift in _drifts(data)]
    remark = (
        f"the beat changes slowly during {', '.join(found)}: something drifts (a stiffness, a motor, a clock, a "
        "camera), and a periodic model does not explain that unless a suspect drifts too; record when the rig has "
        "settled, or shorter"
    )
    return (remark,) if found else ()


def _modulation_remarks(data: WhitenedData, unit: str) -> tuple[str, ...]:
    """Return a remark on recordings whose beats differ periodically; empty if there are none."""
    found = [(name, one.words(amount(one.size, unit))) for name, one in _modulated(data)]
    return (modulation_words(found),) if found else ()


def _modulated(data: WhitenedData) -> list[tuple[str, Modulation]]:
    """Name and modulation of the recordings whose beats differ by more than any model must explain."""
    fits = ((one.name, fit.modulation) for one, fit in zip(data.recordings, data.beat_fits, strict=True))
    return [(name, one) for name, one in fits if one and one.size > data.tolerance]


def _shared_remarks(data: WhitenedData) -> tuple[str, ...]:
    """Return a remark on recordings whose noise is in part a motion that the markers share; empty without any."""
    found = [f"{name} ({100 * share:.0f} %)" for name, share in _shared(data)]
    remark = (
        f"part of what differs between the beats of {', '.join(found)} is a motion that the markers share, not the "
        "noise of single markers: a motion that changes (a stiffness or motor that drifts, beats of different size), "
        "a vibration that is not locked to the beat (a strobe shows it at another frequency), or cameras that turn; "
        "missing physics may hide in it; record more beats"
    )
    return (remark,) if found else ()


def _shared(data: WhitenedData) -> list[tuple[str, float]]:
    """Name and shared part of the noise of recordings in which that is not small, and no other change was found."""
    fits = zip(data.recordings, data.beat_fits, strict=True)
    known = {name for name, _ in (*_drifts(data), *_modulated(data))}
    return [(one.name, fit.shared) for one, fit in fits if fit.shared > data.policy.shared and one.name not in known]


def _uneven_noise_remarks(data: WhitenedData, unit: str) -> tuple[str, ...]:
    """Return a remark on recordings with several times the noise of quieter ones; empty if there are none."""
    names, levels = [one.name for one in data.recordings], data.noise_of_recordings.tolist()
    found = [f"{names[k]} ({amount(levels[k], unit)})" for k in noisier(data)]
    remark = (
        f"the noise of {', '.join(found)} is more than {UNEVEN:g} times the {amount(quiet_noise(data), unit)} of "
        "quieter recordings: what happens there but not in every beat is taken for noise, and missing physics may hide "
        "in it"
    )
    return (remark,) if found else ()


def _faint_remarks(data: WhitenedData) -> tuple[str, ...]:
    """Return a remark if the mean beats are not known well enough for a model to be called adequate; else nothing."""
    part = 100.0 * float(np.median(data.uncertainty_of_beats))
    remark = (
        f"the mean beat is known to only {part:.0f} % of its size, because beats differ or there are few of them: "
        "physics that changes the beat by less cannot be seen; record more beats, or beats that are alike"
    )
    return (remark,) if faint(data) else ()


def marker_remarks(data: WhitenedData, errors: PositionErrors | None, best: Fit) -> tuple[str, ...]:
    """Return a remark on ``errors`` of rest positions, estimated at the fit ``best``; empty if they are negligible."""
    if errors is None:
        remark = (
            "errors of the markers' rest positions are not estimated with so many markers and recordings: fit fewer"
        )
        return (remark,) if data.kind == "tracks" and too_many(data) else ()
    estimated, remarks = errors.estimates(data, best), list[str]()
    if errors.frame:
        remarks.append(_frame_remark(errors.frame, estimated.frame))
    if not errors.sd:
        return tuple(remarks)
    sizes = np.linalg.norm(estimated.rest, axis=1)
    worst = int(np.argmax(sizes))
    remarks.append(
        f"the described rest positions of the markers are wrong by about {amount(errors.sd, data.unit)} along each "
        f"axis ({errors.markers[worst]} by {amount(float(sizes[worst]), data.unit)}): so much do neighbouring markers "
        "differ in every recording. These errors are estimated with every hypothesis, and are not part of any misfit; "
        "measure the positions again to see smaller effects"
    )
    return tuple(remarks)


def _frame_remark(stated: FrameError, found: Float[Array, " 6"]) -> str:
    turned = ", ".join(
        f"{np.degrees(value):.2f} ({np.degrees(sd):.2f})" for value, sd in zip(found[:3], stated.rotation, strict=True)
    )
    moved = ", ".join(f"{1e3 * value:.2f} ({1e3 * sd:.2f})" for value, sd in zip(found[3:], stated.origin, strict=True))
    return (
        f"the frame of the tracks is turned by {turned} deg about x, y and z, and shifted by {moved} mm along them, as "
        "the best explanation shows it (in brackets: the stated standard errors); every hypothesis allows for it, and "
        "it is not part of any misfit"
    )


def drift_sentence(data: WhitenedData, *, explained: bool) -> str:
    """Return a sentence for the summary if the beat changes during recordings; empty if it does not.

    ``explained``: whether the effects that were added explain it.
    """
    drifting, shared, every = len(_drifts(data)), len(_shared(data)), len(data.recordings)
    cause = "which may be the cause" if drifts(data) else "by too little to matter"
    seen = f" The beat changes slowly during {drifting} of {every} recordings"
    found = f"{seen}, as the added effects explain." if explained else f"{seen}: something drifts, {cause}."
    periodic = f" The beats of {len(_modulated(data))} of {every} recordings differ periodically."
    more = f" The beats of {shared} of {every} recordings differ by a motion that the markers share."
    return (found if drifting else "") + (periodic if _modulated(data) else "") + (more if shared else "")


def _drifts(data: WhitenedData) -> list[tuple[str, Drift]]:
    """Name and drift of the recordings during which the beat changes slowly, by more than any model must explain."""
    fits = zip(data.recordings, data.beat_fits, strict=True)
    return [(one.name, fit.drift) for one, fit in fits if fit.drift and fit.drift.size > data.tolerance]
