"""Computation of jobs: the runner, the start of the evaluator, and notification of changes."""
