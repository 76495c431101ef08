"""One diagnosis of a real recording: its rig and data, what others document about it, and how a finding is judged."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from scipy.io import loadmat

from wingfit.diagnosis import DiagnosisSpec, diagnose_rig
from wingfit.diagnosis.finding import Finding
from wingfit.inference.noise.series import UnknownNoiseError
from wingfit.records import SeriesDataset
from wingfit.rigs.rig import Rig
from wingfit.rigs.rig_model import RigModel
from wingfit.workers import make_evaluator

Judgement = Literal["abstained"] | bool
CERTAIN = 0.75  # least probability of a verdict that a model is adequate
SIBLING = Path(__file__).resolve().parents[3] / "shared" / "data"


@dataclass(frozen=True)
class Trial:
    """A rig and its recordings, and what a diagnosis should find.

    Attributes:
        name: of the trial, for ``--only``.
        documented: what others say is missing in the nominal model, in words.
        build: returns rig and dataset from the data folder.
        right: sets of effects that are a right name, each exactly.
        adequate: whether "adequate" is right.
        claims: effects that must not be named; a verdict that names none of them is right where no name is wanted.
        without: suspects that are removed.
        small: whether what is documented may be smaller than the accepted error, so that "adequate" is not wrong.
        control: whether the trial is a control, which is listed apart.
    """

    name: str
    documented: str
    build: Callable[[Path], tuple[Rig, SeriesDataset]]
    right: tuple[frozenset[str], ...] = ()
    adequate: bool = False
    claims: frozenset[str] = field(default_factory=frozenset)
    without: frozenset[str] = field(default_factory=frozenset)
    small: bool = False
    control: bool = False

    def judge(self, finding: Finding) -> Judgement:
        """Return whether ``finding`` is right; "abstained" where it names nothing, or the right name among others.

        A name is wanted where :attr:`right` is not empty; else "adequate", or "unnamed" if :attr:`adequate` is False.
        An ambiguous verdict is right if all its alternatives are; an adequate one with a probability below CERTAIN says
        that missing physics may hide in the noise, and abstains.
        """
        named = frozenset(finding.named)
        possible = [frozenset(one) for one in finding.indistinguishable] or [named]
        if finding.verdict == "adequate":
            certain = finding.probabilities["adequate"] >= CERTAIN and not self.small
            return self.adequate if certain else "abstained"
        if finding.verdict == "unnamed":
            return "abstained" if self.right or self.claims else not self.adequate
        if self.right:
            good = [one in self.right for one in possible] if finding.verdict == "ambiguous" else [named in self.right]
            return all(good) or ("abstained" if any(good) else False)
        if self.claims:
            return not named & self.claims or ("abstained" if finding.verdict == "ambiguous" else False)
        return "abstained" if finding.verdict == "ambiguous" and not self.adequate else False


def data_folder(given: str | None) -> Path | None:
    """Return the folder of the recordings: as ``given``, or beside the project; None if absent."""
    folder = Path(given or SIBLING)
    return folder if folder.is_dir() else None


def read_mat(path: Path) -> dict[str, Any]:
    """Return the variables of the MATLAB file ``path``; FileNotFoundError where there is none."""
    with path.open("rb") as file:
        found: dict[str, Any] = loadmat(file)
    return found


def run(trial: Trial, folder: Path, say: Callable[[str], None]) -> dict[str, Any]:
    """Diagnose ``trial`` and return its row of the table; ``say`` takes lines for the reader."""
    began = time.monotonic()
    row: dict[str, Any] = {"name": trial.name, "documented": trial.documented}
    try:
        rig, dataset = trial.build(folder)
        finding = _diagnosed(rig, dataset, trial.without)
    except UnknownNoiseError as error:
        say(f"{trial.name}: refused: {error}")
        row |= dict.fromkeys(("probability", "heldout_before", "heldout_after", "floor"))
        row |= {"verdict": "refused", "names": [], "right": "abstained", "reason": str(error)}
        return row | {"seconds": round(time.monotonic() - began, 1)}
    for line in _told(trial, finding):
        say(line)
    proof = finding.proof
    return row | {
        "verdict": finding.verdict,
        "names": list(finding.named),
        "probability": round(finding.probabilities[finding.verdict], 3),
        "heldout_before": round(proof.before.value, 3) if proof else None,
        "heldout_after": round(proof.after.value, 3) if proof else None,
        "floor": round(finding.floors.total, 3),
        "right": trial.judge(finding),
        "seconds": round(time.monotonic() - began, 1),
        "strength": round(finding.strength, 3),
        "sizes": {gene.name: gene.value.value for gene in finding.genes if "[" not in gene.name},
        "evaluations": finding.evaluations,
    }


def _diagnosed(rig: Rig, dataset: SeriesDataset, without: frozenset[str]) -> Finding:
    known = (suspect.name for suspect in RigModel(rig, dataset.recordings).suspects)
    spec = DiagnosisSpec(suspects=tuple(name for name in known if name not in without) if without else ())
    *_, last = diagnose_rig(rig, dataset, spec, make_evaluator("in_process"))
    if last.finding is None:
        raise ValueError("the diagnosis ended without a finding")
    return last.finding


def _told(trial: Trial, finding: Finding) -> Iterable[str]:
    yield f"{trial.name}: {finding.verdict} {', '.join(finding.named)} ({finding.seconds:.1f} s)"
    yield f"  {finding.summary}"
    for one in (one for one in finding.hypotheses if one.refitted):
        effects = " + ".join(one.effects) or "(nominal)"
        yield f"  {effects}: p {one.probability:.3f}, evidence {one.evidence:.1f}, misfit {one.misfit:.3g}"
    for channel in finding.channels:
        yield (
            f"  {channel.name}: noise {channel.noise:.3g} {channel.unit} ({channel.source}), residual "
            f"{channel.before:.3g} before, {channel.after:.3g} after"
        )
    sizes = (f"{g.name} {g.value.value:.4g} [{_end(g.value.low)}, {_end(g.value.high)}]" for g in finding.genes)
    yield "  genes: " + ", ".join(one for one in sizes if "[" not in one.split(" ")[0])
    for remark in finding.remarks:
        yield f"  remark: {remark}"


def _end(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
