"""Effects in a calibration: the stage that fits their genes, and remarks on effects that stay switched off."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from wingfit.sim.effects.contract import Effect
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.wing.genes import Group, group

# Aerodynamic, and yet fitted in vacuum: in air it only scales what the coefficients of the air scale as well.
_SEEN_IN_VACUUM = ("residual_air",)


def effect_of(gene: str) -> Effect | None:
    """The effect that a gene belongs to; None for a gene of the model itself."""
    name, _, short = gene.partition(".")
    effect = EFFECTS.get(name)
    return effect if effect and any(p.name == short for p in effect.parameters) else None


def sizes(effect: Effect) -> tuple[str, ...]:
    """The sizes of ``effect``: it is switched off when all these genes are zero."""
    return tuple(f"{effect.name}.{parameter.name}" for parameter in effect.size)


def is_size(gene: str) -> bool:
    """Whether a gene is a size of an effect, which is switched off when all its sizes are zero."""
    effect = effect_of(gene)
    return effect is not None and gene in sizes(effect)


def group_of(gene: str) -> Group:
    """Whether a staged calibration fits a gene of a wing with the structure or with the aerodynamics."""
    effect = effect_of(gene)
    if effect is None:
        return group(gene)
    in_air = effect.family == "aerodynamics" and effect.name not in _SEEN_IN_VACUUM
    return "aerodynamics" if in_air else "structure"


def is_measured(gene: str) -> bool:
    """Whether a gene belongs to a fault of a measurement, which does not act on the wing or its forces."""
    effect = effect_of(gene)
    return effect is not None and effect.family == "measurement"


def refuse_idle(names: Collection[str], free: Collection[str], fixed: Mapping[str, float]) -> None:
    """ValueError for an effect that stays switched off because none of its sizes is searched or fixed."""
    for name in names:
        mine = sizes(EFFECTS[name])
        if not any(size in free or fixed.get(size) for size in mine):
            raise ValueError(
                f"effect {name!r} would stay switched off: none of {', '.join(mine)} is searched; "
                "name one among the genes, or leave the effect out"
            )


def absent(genome: Mapping[str, float], free: Collection[str]) -> tuple[str, ...]:
    """Remarks on effects that are switched off in ``genome``: the values of their other genes are meaningless."""
    found = {effect.name: effect for name in free if (effect := effect_of(name))}
    remarks = []
    for effect in found.values():
        if any(genome[size] != 0.0 for size in sizes(effect)):
            continue
        idle = [name for name in free if effect_of(name) is effect and name not in sizes(effect)]
        without = f", and {', '.join(idle)} {'is' if len(idle) == 1 else 'are'} not determined" if idle else ""
        remarks.append(f"effect {effect.name!r} is switched off in the best genome{without}")
    return tuple(remarks)
