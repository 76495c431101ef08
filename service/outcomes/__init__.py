"""Results of runs on the wire: loads, forces, coefficients, effects."""
