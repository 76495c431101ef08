"""Which genes belong to effects (physics or faults of a measurement, added to a model), and when they are fitted."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from wingfit.rigs.rig_model import RigModel
from wingfit.sim.effects.contract import Effect
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.model import Model
from wingfit.sim.wing.genes import Group, group

# Aerodynamic, and yet fitted in vacuum: in air it only scales what the coefficients of the air scale as well.
_SEEN_IN_VACUUM = ("residual_air",)


def effect_of(gene: str) -> Effect | None:
    """Return the effect that the gene called ``gene`` belongs to; None for a gene of the model itself."""
    name, _, short = gene.partition(".")
    effect = EFFECTS.get(name)
    return effect if effect and any(p.name == short for p in effect.parameters) else None


def sizes(effect: Effect) -> tuple[str, ...]:
    """Return the names of the size genes of ``effect``; if all of them are zero, the effect is switched off."""
    return tuple(f"{effect.name}.{parameter.name}" for parameter in effect.size)


class AddedEffect(NamedTuple):
    """An effect of a model: the names of all its ``genes``, and of those that are its ``sizes``."""

    name: str
    genes: tuple[str, ...]
    sizes: tuple[str, ...]


def added_effects(model: Model, free: Collection[str]) -> list[AddedEffect]:
    """Return the effects that were added to ``model``, of which a gene is in ``free``, in the order of these genes.

    Effects of a user's rig are its suspects.
    """
    if isinstance(model, RigModel):
        known = [AddedEffect(one.name, tuple(g.name for g in one.genes), one.size_genes) for one in model.added]
    else:
        names = [gene.name for gene in model.genes]
        effects = {effect.name: effect for name in names if (effect := effect_of(name))}
        known = [
            AddedEffect(one.name, tuple(name for name in names if effect_of(name) is one), sizes(one))
            for one in effects.values()
        ]
    of_gene = {name: one for one in known for name in one.genes}
    return list(dict.fromkeys(of_gene[name] for name in free if name in of_gene))


def is_size(gene: str) -> bool:
    """Return whether the gene is a size of an effect, that is, says how strong the effect is (zero: off)."""
    effect = effect_of(gene)
    return effect is not None and gene in sizes(effect)


def group_of(gene: str) -> Group:
    """Return in which stage of a staged calibration a gene of a wing is fitted: "structure" or "aerodynamics"."""
    effect = effect_of(gene)
    if effect is None:
        return group(gene)
    in_air = effect.family == "aerodynamics" and effect.name not in _SEEN_IN_VACUUM
    return "aerodynamics" if in_air else "structure"


def is_measured(gene: str) -> bool:
    """Return whether the gene belongs to a fault of the measurement, which changes recordings but not the motion."""
    effect = effect_of(gene)
    return effect is not None and effect.family == "measurement"


def refuse_idle(effects: Mapping[str, Sequence[str]], free: Collection[str], fixed: Mapping[str, float]) -> None:
    """Raise ValueError if an effect would stay switched off, as none of its sizes can be non-zero.

    ``effects``: names of the size genes of each effect by its name. A size can be non-zero if it is searched (in
    ``free``) or has a non-zero value in ``fixed``.
    """
    for name, mine in effects.items():
        if not any(size in free or fixed.get(size) for size in mine):
            raise ValueError(
                f"effect {name!r} would stay switched off: none of {', '.join(mine)} is searched; "
                "name one among the genes, or leave the effect out"
            )


def absent(genome: Mapping[str, float], free: Collection[str]) -> tuple[str, ...]:
    """Return remarks on effects that are switched off in ``genome``: the values of their other genes are meaningless.

    ``genome`` has the value of every gene by name; effects without a ``free`` gene are not considered.
    """
    found = {effect.name: effect for name in free if (effect := effect_of(name))}
    return tuple(
        switched_off(AddedEffect(one.name, tuple(name for name in free if effect_of(name) is one), sizes(one)), free)
        for one in found.values()
        if all(genome[size] == 0.0 for size in sizes(one))
    )


def switched_off(effect: AddedEffect, free: Collection[str]) -> str:
    """Return the remark that ``effect`` is switched off in the best genome, with its ``free`` genes of no meaning."""
    idle = [name for name in effect.genes if name in free and name not in effect.sizes]
    without = f", and {', '.join(idle)} {'is' if len(idle) == 1 else 'are'} not determined" if idle else ""
    return f"effect {effect.name!r} is switched off in the best genome{without}"
