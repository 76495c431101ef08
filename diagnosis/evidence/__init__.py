"""Reduce recordings to whitened coefficients, fit hypotheses to these, and score-test suspects."""
