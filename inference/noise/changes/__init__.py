"""Changes from beat to beat that are no noise: slow drifts, and odd and even beats that differ."""
