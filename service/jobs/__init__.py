"""How jobs are computed: the runner, the evaluator, and those who wait for changes."""
