"""The API process on a cluster, for the two-node test: joins, evaluates on command, and prints results."""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path

from tests.workers import pendulum
from wingfit.calibration.problem import Evaluation
from wingfit.workers import make_evaluator

ANSWER = "answer: "


def digest(evaluation: Evaluation) -> str:
    """Hash of every number of an evaluation."""
    whole = hashlib.sha256()
    for part in evaluation.per_recording:
        assert part.residuals is not None
        for array in (part.squares, part.distance, part.residuals):
            whole.update(array.tobytes())
        whole.update(repr((part.samples, part.reasons)).encode())
    return whole.hexdigest()


def tell(answer: str) -> None:
    """Print an answer with a mark, because Ray prints too."""
    print(ANSWER + json.dumps(answer), flush=True)


def main(address: str) -> None:
    try:
        evaluator = make_evaluator("ray", address=address)
    except ConnectionError as error:
        tell(f"refused: {error}")
        return
    tell("joined")
    for line in sys.stdin:
        folder, seconds, individuals = json.loads(line)
        if not individuals:
            tell(str(evaluator.standing.workers))
            continue
        problem = pendulum.problem(pendulum.Note(Path(folder), seconds))
        evaluation = evaluator.evaluate(problem, pendulum.population(individuals), residuals=True)
        tell(digest(evaluation))
    evaluator.close()


if __name__ == "__main__":
    main(sys.argv[1])
