"""Common parts of both case studies: save and diagnose a dataset, write the report, take figures from the finding."""

from __future__ import annotations

import shutil
import webbrowser
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from wingfit.cli.base.output import progress
from wingfit.diagnosis.finding import Finding, GeneValue, Hypothesis
from wingfit.records import Dataset, save_dataset
from wingfit.report import html
from wingfit.service.diagnoses.local import diagnose

Numbers = Mapping[str, Any]

IN_A_TERMINAL = ("www-browser", "links", "elinks", "lynx", "w3m")
"""Browsers that run in the terminal and draw no figures."""


@dataclass(frozen=True)
class Claim:
    """A statement about the result of a study (``words``), and whether it holds."""

    words: str
    holds: bool


@dataclass(frozen=True)
class Story:
    """Result of a study: ``figures`` for JSON, ``lines`` of text, ``claims``, and the path of the report."""

    figures: Numbers
    lines: tuple[str, ...]
    claims: tuple[Claim, ...]
    report: Path

    def as_json(self) -> dict[str, Any]:
        """The figures, claims and path of the report as a dictionary for JSON."""
        return {**self.figures, "claims": [asdict(claim) for claim in self.claims], "report": str(self.report)}


def saved(dataset: Dataset, folder: Path) -> Path:
    """Write ``dataset`` to a folder of its name in ``folder``, replacing that of an earlier run; return its path."""
    path = folder / dataset.name
    if (path / "dataset.yaml").is_file():
        shutil.rmtree(path)
    save_dataset(dataset, path)
    return path


def diagnosed(path: Path, options: Mapping[str, Any], workers: int) -> tuple[Finding, Path]:
    """Diagnose the dataset at ``path`` as ``wingfit diagnose --local`` does; return the finding and the report's path.

    The diagnosis receives only the files and ``options``, a request of that command. The report is written beside the
    dataset.
    """
    with progress(f"{path.name}: diagnosing") as tell:
        finding = diagnose(path, dict(options), workers, tell)
    page = path.with_name(f"{path.name}.html")
    page.write_text(html(finding), encoding="utf-8")
    return finding, page


def leader(finding: Finding) -> Hypothesis:
    """The hypothesis that the verdict names, else the most probable one."""
    named = set(finding.named)
    return next((one for one in finding.hypotheses if set(one.effects) == named), finding.hypotheses[0])


def nominal_misfit(finding: Finding) -> float:
    """RMS residual of the refitted nominal model, m or N."""
    return next(one.misfit for one in finding.hypotheses if not one.effects)


def families(finding: Finding) -> tuple[str, ...]:
    """Family (structure, actuation, ...) of each effect that the finding names; "" if unknown."""
    known = {one.effects[0]: one.family for one in finding.hypotheses if len(one.effects) == 1}
    return tuple(known.get(name, "") for name in finding.named)


def beside_truth(genes: Mapping[str, GeneValue], truth: Mapping[str, float]) -> list[dict[str, Any]]:
    """One row per true value: gene, true value, estimate, bounds of the 90 % interval, and whether it covers the truth.

    Estimate and bounds are None if ``genes`` has no such gene, a bound also if the data do not bound the gene;
    ``covered`` is None if a bound is.
    """
    rows = []
    for name, true in truth.items():
        found = genes[name].value if name in genes else None
        ends = (None, None) if found is None else (found.low, found.high)
        rows.append(
            {
                "gene": name,
                "true": true,
                "found": None if found is None else found.value,
                "low": ends[0],
                "high": ends[1],
                "covered": None if None in ends else bool(ends[0] <= true <= ends[1]),  # type: ignore[operator]
            }
        )
    return rows


def over_floor(finding: Finding) -> dict[str, float | None]:
    """Held-out misfit divided by the smallest misfit that can be expected, before and after the diagnosis.

    After it also with the bounds of the 90 % interval; None without held-out recordings.
    """
    proof = finding.proof
    return {
        "heldout_before_over_floor": None if proof is None else proof.before.value,
        "heldout_over_floor": None if proof is None else proof.after.value,
        "heldout_over_floor_low": None if proof is None else proof.after.low,
        "heldout_over_floor_high": None if proof is None else proof.after.high,
    }


def opened(page: Path) -> bool:
    """Open the HTML file ``page`` in a graphical browser; return whether that succeeded."""
    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return False
    if isinstance(browser, webbrowser.GenericBrowser) and browser.name in IN_A_TERMINAL:
        return False
    return browser.open(page.resolve().as_uri())
