"""Draw the reliability of verdicts: ``python -m docs.generate.reliability_figure RESULT`` writes it as SVG.

RESULT: a file whose last line is the JSON object of ``python -m benchmarks.concealed --json``.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.common.svg import Line, Panel, svg

FIGURE = Path(__file__).parents[2] / "docs" / "figures" / "reliability.svg"


def panel(bins: Sequence[dict[str, float]]) -> Panel:
    """Return the diagram: share of true verdicts against the probability that was given, both per cent."""
    said, right = (np.array([one[key] for one in bins]) for key in ("said_percent", "right_percent"))
    ideal = np.array([min(said.min(), right.min()), 100.0])
    lines = (Line("as given", ideal, ideal), Line("true", said, right, dots=True))
    return Panel("Reliability of verdicts", "probability given, %", "true, %", lines)


def main() -> None:
    """Write the figure of the result that the command line names."""
    parser = argparse.ArgumentParser(prog="python -m docs.generate.reliability_figure", description=__doc__)
    parser.add_argument("result", type=Path)
    found = json.loads(parser.parse_args().result.read_text(encoding="utf-8").splitlines()[-1])
    FIGURE.write_text(svg([panel(found["calibration"]["bins"])]), encoding="utf-8")
    print(FIGURE)


if __name__ == "__main__":
    main()
