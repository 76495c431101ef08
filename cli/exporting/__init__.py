"""The command that takes a calibrated model away."""
