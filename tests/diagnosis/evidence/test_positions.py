"""A size that is a choice, such as a wrong sign, is one of its positions or zero; a fit between them is rejected."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from wingfit import Gene, Suspect
from wingfit.diagnosis.evidence.refit import is_in_position

SIGN = Suspect(
    "sign", genes=(Gene("sign.part", "1", 0.0, -2.0, 60.0),), positions={"sign.part": (-2.0, 56.3)}
)  # fmt: skip


def fitted(value: float) -> Any:
    trial = SimpleNamespace(suspect=SIGN)
    return SimpleNamespace(trials=(trial,), fit=SimpleNamespace(values={"sign.part": value}))


@pytest.mark.parametrize(("value", "accepted"), [(-2.0, True), (-1.6, True), (58.9, True), (0.001, False)])
def test_near_a_position(value: float, accepted: bool) -> None:
    assert is_in_position(fitted(value)) == accepted


@pytest.mark.parametrize("value", [-1.0, -0.1, 0.1, 3.0, 40.0])
def test_between_positions(value: float) -> None:
    assert not is_in_position(fitted(value))


def test_zero_will_do_beside_an_amount() -> None:
    """A body pitch may have the wrong zero and the right sign."""
    both = Suspect("pitch", genes=(*SIGN.genes, Gene("pitch.angle", "rad", 0.0, -1.0, 1.0)), positions=SIGN.positions)
    refit = fitted(0.001)
    refit.trials[0].suspect = both
    assert is_in_position(refit)


@pytest.mark.parametrize(
    ("x", "z", "accepted"),
    [(0.0, 1.0, True), (0.01, 0.99, True), (0.1, 1.0, False), (0.5, 1.0, False), (0.01, 0.0, False)],
)
def test_another_choice_need_not_be_exactly_zero(x: float, z: float, accepted: bool) -> None:
    """A wrong sign along z leaves the one along x at a part that noise explains; such a part alone is no fault."""
    names = ("axis.x", "axis.z")
    axes = Suspect(
        "axis", genes=tuple(Gene(name, "1", 0.0, 0.0, 1.0) for name in names), positions=dict.fromkeys(names, (1.0,))
    )
    trial = SimpleNamespace(suspect=axes)
    refit: Any = SimpleNamespace(trials=(trial,), fit=SimpleNamespace(values=dict(zip(names, (x, z), strict=True))))
    assert is_in_position(refit) == accepted


def test_positions_are_of_genes_that_exist() -> None:
    with pytest.raises(ValueError, match=r"suspect 'sign' has no gene 'other'"):
        Suspect("sign", genes=SIGN.genes, positions={"other": (1.0,)})
