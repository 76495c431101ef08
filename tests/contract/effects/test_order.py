"""The order of the registry is physics: each pair that does not commute, and why it stands as it does."""

from __future__ import annotations

from itertools import pairwise

import pytest

from wingfit.records import Vehicle, Wing
from wingfit.sim.effects.registry import EFFECTS, chosen
from wingfit.sim.virtual_rigs.balance import delfly
from wingfit.sim.virtual_rigs.campaign import robird_wing

FIRST_LAST_WHY = (
    ("residual_air", "added_mass", "the mass of the air moved along is that of the air there is"),
    ("leading_edge_vortex", "dynamic_stall", "stall takes from lift of the angle of attack, by whatever law it comes"),
    ("dynamic_stall", "rotational_circulation", "Kirchhoff's law is one of the angle of attack, not of the pitch rate"),
    ("leading_edge_vortex", "circulation_lag", "whatever circulation a strip has follows late, the vortex's as well"),
    ("dynamic_stall", "circulation_lag", "what separation leaves is the target that the circulation follows late"),
    ("rotational_circulation", "circulation_lag", "Theodorsen's lag is one of flow at 3/4 chord, pitch rate included"),
    ("dynamic_stall", "clap_and_peel", "two wings that open suck air into the gap: nothing separates there"),
    ("circulation_lag", "clap_and_peel", "both wings' circulations are opposite: no vortex is shed that holds them up"),
    ("clap_and_peel", "tip_loss", "at the tip fling has to end like any circulation"),
    ("circulation_lag", "tip_loss", "plane flow sets the lag, and what has grown then leaks round the tip"),
    ("tip_loss", "induced_inflow", "the inflow is driven by the lift that is there, without what the tip has lost"),
    ("circulation_lag", "induced_inflow", "the inflow is driven by the lift that is there, with what is late"),
    ("clap_and_peel", "induced_inflow", "the inflow is driven by the lift that is there, fling included"),
)


@pytest.mark.parametrize(("first", "last", "why"), FIRST_LAST_WHY)
def test_pairs_that_do_not_commute(first: str, last: str, why: str) -> None:
    names = list(EFFECTS)
    assert names.index(first) < names.index(last), f"{first} must come before {last}: {why}"


@pytest.mark.parametrize("rig", [robird_wing(), delfly()], ids=["wing", "vehicle"])
def test_the_order_is_the_registrys_however_effects_are_named(rig: Wing | Vehicle) -> None:
    """Also of those that act on a scene at the same stage."""
    names = [name for name, effect in EFFECTS.items() if effect.applies_to(rig)]
    assert [effect.name for effect in chosen(names[::-1], rig)] == names
    for first, last in pairwise(names):
        assert [effect.name for effect in chosen((last, first), rig)] == [first, last]
