"""The physical terms of the quasi-steady force, each of which can be omitted, and published models composed of them."""

from __future__ import annotations

from dataclasses import dataclass

from wingfit.records import Gene

ARMANINI = "Armanini, Caetano, de Croon, de Visser and Mulder, Bioinspiration & Biomimetics 11, 046002 (2016)"
BERMAN = "Berman and Wang, Journal of Fluid Mechanics 582, 153 (2007)"
DICKINSON = "Dickinson, Lehmann and Sane, Science 284, 1954 (1999)"
SANE = "Sane and Dickinson, Journal of Experimental Biology 205, 1087 (2002)"


@dataclass(frozen=True)
class Term:
    """A physical term of the wing's force: the genes that are its coefficients, equation, source and description."""

    name: str
    genes: tuple[Gene, ...]
    equation: str
    source: str
    description: str


def _coefficient(name: str, nominal: float, upper: float, text: str) -> Gene:
    return Gene(name, "1", nominal, 0.0, upper, "linear", text)


# Nominal values are the initial guesses of Table 6. That of C_Dpi2 is illegible there; 2 is the value of a flat plate.
TERMS = {
    name: Term(name, genes, equation, source, text)
    for name, source, equation, text, genes in (
        (
            "inertial", ARMANINI, "Eqs. 12-14, the terms with theta_w'",
            "wing mass and added mass in axes that rotate with the wing",
            (),
        ), (
            "translation", ARMANINI, "Eqs. 2, 3, 8",
            "circulation of a wing in translation, leading-edge vortex included",
            (_coefficient("C_l", 1.0, 5.0, "coefficient of lift, C_L = C_l sin 2 alpha (Eq. 3)"),),
        ), (
            "rotation", ARMANINI, "Eqs. 2, 4, 8",
            "circulation of a wing that pitches (Kramer effect)",
            (_coefficient("C_r", 1.6, 8.0, "coefficient of rotational circulation, C_R = C_r (0.75 - x0) (Eq. 4)"),),
        ), (
            "clap_and_peel", ARMANINI, "Eq. 7",
            "circulation of two wings that peel apart; replaces rotational circulation until they stop pitching",
            (_coefficient("C_F", 1.0, 5.0, "fling coefficient, of circulation while the wings peel (Eq. 7)"),),
        ), (
            "added_mass", ARMANINI, "Eqs. 9, 10", "air accelerated with the wing", (),
        ), (
            "effective_chord", ARMANINI, "below Eqs. 10 and 19",
            "only the part of the chord that has come apart carries added mass",
            (),
        ), (
            "viscous", ARMANINI, "Eq. 11", "friction and pressure drag of the plate",
            (
                _coefficient("C_D0", 0.0, 1.0, "drag coefficient at zero angle of attack (Eq. 11)"),
                _coefficient("C_Dpi2", 2.0, 5.0, "drag coefficient at 90 degrees angle of attack (Eq. 11)"),
            ),
        ), (
            "wing_acceleration", ARMANINI, "derived: the acceleration that Eqs. 12-14 omit from the wing's inertia",
            "with this term, the mean force of the wing's own mass over a beat is zero",
            (),
        ), (
            "steady_curves", DICKINSON,
            "C_L = 0.225 + 1.58 sin(2.13 alpha - 7.20), C_D = 1.92 - 1.55 cos(2.04 alpha - 9.82), degrees",
            "lift and drag measured on a revolving model wing, in place of translation and viscous",
            (
                _coefficient("K_l", 1.0, 5.0, "factor on the lift measured on a revolving wing"),
                _coefficient("K_d", 1.0, 5.0, "factor on the drag measured on a revolving wing"),
            ),
        ),
    )
}  # fmt: skip
SEARCHED = ("C_l", "C_r", "C_F", "K_l", "K_d")
DRAG = ("C_D0", "C_Dpi2")  # forces along two axes tell drag from lift, those along one do not


@dataclass(frozen=True)
class Preset:
    """A published model: names of its terms (keys of TERMS), its source and a description."""

    name: str
    terms: tuple[str, ...]
    source: str
    description: str


PRESETS = {
    name: Preset(name, terms, source, text)
    for name, source, terms, text in (
        (
            "proposed", ARMANINI,
            ("inertial", "translation", "rotation", "clap_and_peel", "added_mass", "effective_chord", "viscous"),
            "with clap-and-peel",
        ), (
            "berman_wang", BERMAN, ("inertial", "translation", "rotation", "added_mass", "viscous"),
            "single wings that do not meet; the baseline of Armanini et al. (2016)",
        ), (
            "dickinson", f"{DICKINSON}; {SANE}", ("steady_curves", "rotation", "added_mass"),
            "measured steady curves, rotational circulation and added mass (Table 2 of Armanini et al.)",
        ),
    )
}  # fmt: skip


def chosen(preset: str, without: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Names of the terms of the published model ``preset`` less those in ``without``; ValueError for unknown names."""
    if preset not in PRESETS:
        raise ValueError(f"unknown model {preset!r}; there are {', '.join(PRESETS)}")
    terms = PRESETS[preset].terms
    for name in without:
        if name not in terms:
            raise ValueError(f"model {preset!r} has no term {name!r} to leave out; it has {', '.join(terms)}")
    return tuple(name for name in terms if name not in without)
