"""Report what a running search knows so far, as a partial finding."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.diagnosis.evidence.nominal import Nominal
from wingfit.diagnosis.location import maps
from wingfit.diagnosis.location.in_series import channel_misfits
from wingfit.diagnosis.partial_finding import Lead, PartialFinding, PlaceMisfit
from wingfit.diagnosis.search_state import SearchState
from wingfit.diagnosis.subject import beat_subject
from wingfit.diagnosis.verdict.verdict import explained_fraction, explained_in_score_test

MOST_LEADS = 8


@dataclass
class PartialFindings:
    """Makes partial findings of one search; what holds for a nominal fit is computed once for it."""

    _nominal: Nominal | None = None
    _places: tuple[PlaceMisfit, ...] = ()
    _suspects: int = 0

    def of(self, state: SearchState) -> PartialFinding | None:
        """Return what the search knows; None before the nominal model has been fitted."""
        nominal = state.nominal
        if nominal is None:
            return None
        if nominal is not self._nominal:
            self._nominal, self._places, self._suspects = nominal, _places(state), len(state.suspects)
        return PartialFinding(
            unit={"tracks": "m", "forces": "N"}.get(state.data.kind, "1"),
            noise=float(state.data.noise),
            misfit=float(np.sqrt(max(nominal.refit.excess, 0.0) + state.data.noise**2)),
            places=self._places,
            outline=() if state.data.kind == "series" else beat_subject(state.subject).outline,
            leads=_leads(state),
            tested=len(state.trials),
            suspects=self._suspects,
        )


def _places(state: SearchState) -> tuple[PlaceMisfit, ...]:
    data, coefficients = state.data, state.fitted_nominal.refit.fit.coefficients
    if data.kind == "series":
        channels = channel_misfits(data, coefficients, coefficients)
        return tuple(PlaceMisfit(one.name, one.unit, one.before) for one in channels)
    residuals = maps.recording_residuals(beat_subject(state.subject), data, coefficients)
    unit = "m" if data.kind == "tracks" else "N"
    return tuple(PlaceMisfit(one.name, unit, one.before, one.x, one.y) for one in maps.markers(residuals, residuals))


def _leads(state: SearchState) -> tuple[Lead, ...]:
    before = state.fitted_nominal.refit.excess
    refitted = [
        Lead(
            one.names,
            " and ".join(trial.suspect.title for trial in one.trials),
            explained_fraction(one.excess, before),
            refitted=True,
        )
        for one in state.refits
    ]
    known = {lead.effects for lead in refitted}
    tested = [
        Lead((one.suspect.name,), one.suspect.title, explained_in_score_test(one, state.data), refitted=False)
        for one in (trials[0] for trials in state.trials if trials)
        if (one.suspect.name,) not in known
    ]
    return tuple(sorted((*refitted, *tested), key=lambda lead: -lead.explained)[:MOST_LEADS])
