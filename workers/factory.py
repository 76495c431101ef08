"""Creates an evaluator of a given kind."""

from __future__ import annotations

from typing import get_args

from wingfit.workers.running_evaluator import EvaluatorKind, RunningEvaluator


def make_evaluator(kind: EvaluatorKind, workers: int | None = None, address: str | None = None) -> RunningEvaluator:
    """Start an evaluator (see :mod:`wingfit.workers`) and return it.

    ``workers``: number of worker processes, by default one per processor. ``address`` ("host:port" or "auto", only for
    Ray): the existing cluster to join, of which all processors are used; if None, Ray starts on this machine.
    """
    if workers is not None and workers < 1:
        raise ValueError(f"workers is {workers}; it must be at least 1, or absent for one per processor")
    if address is not None and kind != "ray":
        raise ValueError(f"a Ray address ({address}) needs the evaluator 'ray', not {kind!r}")
    if address is not None and "://" in address:
        raise ValueError(f"the Ray address is {address!r}; write host:port, and run a node of it on this machine")
    if kind == "in_process":
        from wingfit.workers.in_process import InProcessEvaluator

        return InProcessEvaluator()
    if kind == "processes":
        from wingfit.workers.processes import ProcessPoolEvaluator

        return ProcessPoolEvaluator(workers)
    if kind == "ray":
        from wingfit.workers.ray_cluster import RayEvaluator

        return RayEvaluator(workers, address)
    raise ValueError(f"unknown evaluator {kind!r}; give one of {', '.join(get_args(EvaluatorKind))}")
