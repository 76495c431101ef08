"""The physical terms of the quasi-steady force, each of which can be left out, and named models made of them."""

from __future__ import annotations

from dataclasses import dataclass

from wingfit.records import Gene

ARMANINI = "Armanini, Caetano, de Croon, de Visser and Mulder, Bioinspiration & Biomimetics 11, 046002 (2016)"
BERMAN = "Berman and Wang, Journal of Fluid Mechanics 582, 153 (2007)"
DICKINSON = "Dickinson, Lehmann and Sane, Science 284, 1954 (1999)"
SANE = "Sane and Dickinson, Journal of Experimental Biology 205, 1087 (2002)"


@dataclass(frozen=True)
class Term:
    """One term: the genes that scale it, where it stands in print, and what it is."""

    name: str
    genes: tuple[Gene, ...]
    equation: str
    source: str
    description: str


def _coefficient(name: str, nominal: float, upper: float, text: str) -> Gene:
    return Gene(name, "1", nominal, 0.0, upper, "linear", text)


# Nominal values are the initial guesses of Table 6; the one of C_Dpi2 cannot be read there, 2 is a flat plate's.
TERMS = {
    term.name: term
    for term in (
        Term(
            "inertial",
            (),
            "Eqs. 12-14, the parts with theta_w'",
            ARMANINI,
            "wing and added mass carried round by the turning of the wing's axes",
        ),
        Term(
            "translation",
            (_coefficient("C_l", 1.0, 5.0, "coefficient of lift, C_L = C_l sin 2 alpha (Eq. 3)"),),
            "Eqs. 2, 3, 8",
            ARMANINI,
            "circulation of a wing that moves through the air, leading-edge vortex included",
        ),
        Term(
            "rotation",
            (_coefficient("C_r", 1.6, 8.0, "coefficient of rotational circulation, C_R = C_r (0.75 - x0) (Eq. 4)"),),
            "Eqs. 2, 4, 8",
            ARMANINI,
            "circulation of a wing that pitches (Kramer effect)",
        ),
        Term(
            "clap_and_peel",
            (_coefficient("C_F", 1.0, 5.0, "fling coefficient, of circulation while the wings peel (Eq. 7)"),),
            "Eq. 7",
            ARMANINI,
            "circulation of two wings that peel apart, instead of rotational circulation, until they stop pitching",
        ),
        Term("added_mass", (), "Eqs. 9, 10", ARMANINI, "air accelerated with the wing"),
        Term(
            "effective_chord",
            (),
            "below Eqs. 10 and 19",
            ARMANINI,
            "only the part of the chord that has come apart carries added mass",
        ),
        Term(
            "viscous",
            (
                _coefficient("C_D0", 0.0, 1.0, "drag coefficient at zero angle of attack (Eq. 11)"),
                _coefficient("C_Dpi2", 2.0, 5.0, "drag coefficient at 90 degrees angle of attack (Eq. 11)"),
            ),
            "Eq. 11",
            ARMANINI,
            "friction and pressure drag of the plate",
        ),
        Term(
            "wing_acceleration",
            (),
            "the acceleration that Eqs. 12-14 leave out of the wing's inertia; derived",
            ARMANINI,
            "with it, the wing's own mass gives no force on average over a beat, as it must",
        ),
        Term(
            "steady_curves",
            (
                _coefficient("K_l", 1.0, 5.0, "factor on the lift measured on a revolving wing"),
                _coefficient("K_d", 1.0, 5.0, "factor on the drag measured on a revolving wing"),
            ),
            "C_L = 0.225 + 1.58 sin(2.13 alpha - 7.20), C_D = 1.92 - 1.55 cos(2.04 alpha - 9.82), degrees",
            DICKINSON,
            "lift and drag of a revolving model wing, instead of translation and viscous",
        ),
    )
}
SEARCHED = ("C_l", "C_r", "C_F", "K_l", "K_d")


@dataclass(frozen=True)
class Preset:
    """A published model: its terms and its source."""

    name: str
    terms: tuple[str, ...]
    source: str
    description: str


PRESETS = {
    preset.name: preset
    for preset in (
        Preset(
            "proposed",
            ("inertial", "translation", "rotation", "clap_and_peel", "added_mass", "effective_chord", "viscous"),
            ARMANINI,
            "with clap-and-peel",
        ),
        Preset(
            "berman_wang",
            ("inertial", "translation", "rotation", "added_mass", "viscous"),
            BERMAN,
            "single wings that do not meet; the baseline of Armanini et al. (2016)",
        ),
        Preset(
            "dickinson",
            ("steady_curves", "rotation", "added_mass"),
            f"{DICKINSON}; {SANE}",
            "measured steady curves, rotational circulation and added mass (Table 2 of Armanini et al.)",
        ),
    )
}


def chosen(preset: str, without: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Terms of the model called ``preset`` less those in ``without``; ValueError for an unknown name."""
    if preset not in PRESETS:
        raise ValueError(f"unknown model {preset!r}; there are {', '.join(PRESETS)}")
    terms = PRESETS[preset].terms
    for name in without:
        if name not in terms:
            raise ValueError(f"model {preset!r} has no term {name!r} to leave out; it has {', '.join(terms)}")
    return tuple(name for name in terms if name not in without)
