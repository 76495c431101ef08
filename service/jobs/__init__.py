"""Computation of jobs (runs and diagnoses): the runner, the start of the evaluator, notification of changes."""
