"""Examples of JSON answers, for the OpenAPI document."""

from __future__ import annotations

from collections.abc import Mapping

from wingfit.calibration.spec import CalibrationSpec
from wingfit.client.answers import Dataset, Job, Problem, RecordingInfo, Run
from wingfit.client.diagnosis_answers import Diagnosis
from wingfit.client.films.answers import Film, Tracking
from wingfit.client.key_answers import Key, NewKey, Session
from wingfit.diagnosis.spec import DiagnosisSpec
from wingfit.service.auth.key_schemas import SECRET
from wingfit.service.diagnoses.views import diagnosis_settings
from wingfit.service.films.requests import FILM_ID
from wingfit.service.outcomes.requests import RECORDING
from wingfit.service.runs.requests import DATASET_ID
from wingfit.service.runs.spec_views import run_settings

_RECORDING: RecordingInfo = {
    "name": RECORDING,
    "rig": "vacuum_chamber",
    "held_out": False,
    "frames": 90,
    "markers": 40,
    "channels": [],
    "missing_percent": 4.2,
    "settings": {},
    "duration_s": 0.989,
    "flap_frequency_hz": 3.0,
    "phase_lag_deg": 0.0,
    "pressure_mbar": 10.0,
    "temperature_c": 20.0,
    "airspeed_m_s": 0.0,
    "angle_of_attack_deg": 0.0,
}
_DATASET: Dataset = {
    "id": DATASET_ID,
    "name": "Robird campaign",
    "kind": "tracks",
    "description": "Left wing, vacuum chamber and wind tunnel",
    "created_at": "2026-11-05T09:30:00.000000Z",
    "sha256": "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
    "size_bytes": 1482003,
    "markers": 49,
    "notes": "after the repair of the rear rod",
    "rig": None,
    "recordings": [_RECORDING],
    "warnings": [],
}
_JOB: Job = {
    "id": "run_5c1e07a94bd83f26",
    "name": "first try",
    "dataset_id": DATASET_ID,
    "kind": "tracks",
    "state": "RUNNING",
    "stage": "structural",
    "progress": 0.31,
    "eta_seconds": 84.0,
    "created_at": "2026-11-05T09:31:00.000000Z",
    "started_at": "2026-11-05T09:31:00.120000Z",
    "finished_at": None,
    "evaluations": 600,
    "error": None,
    "rig": None,
    "driven": False,
    "residual_over_noise": None,
    "held_out_over_noise": None,
    "fit_badge": None,
    "notes": "",
}
_RUN: Run = {
    **_JOB,
    "spec": run_settings(CalibrationSpec(mode="staged", method="genetic")),
    "pending_action": None,
    "generations": 12,
    "best_mm": 1.84,
    "best_mn": None,
    "best_percent": None,
}
_DIAGNOSIS: Diagnosis = {
    **_JOB,
    "id": "dx_7d20c14be5a9f386",
    "name": "Robird campaign, division 11",
    "stage": "refitting with hinge offset",
    "run_id": None,
    "spec": diagnosis_settings(DiagnosisSpec()),
    "pending_action": None,
    "steps": 48,
    "verdict": None,
    "summary": None,
}
_FILM: Film = {
    "id": FILM_ID,
    "name": "run 3",
    "created_at": "2026-11-05T09:30:00.000000Z",
    "cameras": [
        {"name": name, "bytes": 48_120_331, "frames": 3100, "width_px": 1920, "height_px": 1080, "rate_hz": 100.0}
        for name in ("left", "right")
    ],
    "calibration": True,
    "ready": True,
    "missing": [],
    "size_bytes": 96_240_662,
}
_TRACKING: Tracking = {
    "id": "tk_9e0b6a7c1d2f3458",
    "name": "run 3, chequer",
    "film_id": FILM_ID,
    "dataset_id": None,
    "spec": {
        "kind": "chequer",
        "light": "strobe",
        "clocks_within_ms": 0.0,
        "first_frame": 0,
        "last_frame": None,
        "places": [{"marker": "m01", "x_m": 0.02, "y_m": 0.11, "z_m": 0.0}],
        "labels": [],
    },
    "state": "RUNNING",
    "stage": "detecting",
    "progress": 0.42,
    "eta_seconds": 43.0,
    "created_at": "2026-11-05T09:31:00.000000Z",
    "started_at": "2026-11-05T09:31:00.120000Z",
    "finished_at": None,
    "pending_action": None,
    "steps": 61,
    "error": None,
}
_PROBLEM: Problem = {
    "type": "urn:wingfit:problem:invalid",
    "title": "Unprocessable Entity",
    "status": 422,
    "detail": "the request is invalid",
    "errors": [{"where": "body.seed", "value": -1, "message": "Input should be greater than or equal to 0"}],
}
_KEY: Key = {
    "id": "key_5c1e07a94bd83f26",
    "name": "bench in room 3",
    "owner": "wind tunnel group",
    "scopes": ["read", "write"],
    "created_at": "2026-11-05T09:30:00.000000Z",
    "revoked_at": None,
}
_NEW_KEY: NewKey = {**_KEY, "secret": SECRET}
_SESSION: Session = {"keys_required": True, "key_id": _KEY["id"], "owner": _KEY["owner"], "scopes": _KEY["scopes"]}

EXAMPLES: Mapping[type, Mapping[str, object]] = {
    Dataset: _DATASET,
    Run: _RUN,
    Diagnosis: _DIAGNOSIS,
    Film: _FILM,
    Tracking: _TRACKING,
    Problem: _PROBLEM,
    Key: _KEY,
    NewKey: _NEW_KEY,
    Session: _SESSION,
}
