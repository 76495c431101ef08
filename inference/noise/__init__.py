"""Models of measurement noise: independent samples, correlated samples, and differences between beats."""
