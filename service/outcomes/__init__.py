"""JSON answers about results of runs and simulations: loads, forces, coefficients."""
