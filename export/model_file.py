"""Convert a calibrated model to JSON, and back, without loss."""

from __future__ import annotations

import pydantic

from wingfit.export.calibrated_model import CalibratedModel

_ADAPTER = pydantic.TypeAdapter(CalibratedModel)


def model_json(model: CalibratedModel) -> str:
    """Return ``model`` as JSON text in SI units; ValueError if a value is not finite."""
    text = _ADAPTER.dump_json(model, indent=2).decode() + "\n"
    if model_from_json(text) != model:  # JSON has no NaN and no infinity
        raise ValueError(f"the model of {model.provenance.id} has a value that is not finite: calibrate again")
    return text


def model_from_json(text: str | bytes) -> CalibratedModel:
    """Return the model that :func:`model_json` wrote as ``text``; ValueError that names the first field at fault."""
    try:
        return _ADAPTER.validate_json(text)
    except pydantic.ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "the document"
        raise ValueError(
            f"not a calibrated model: {place}: {first['msg']} ({error.error_count()} in all); write one with "
            "'wingfit export ... --format json'"
        ) from None
