"""The result of a calibration of a rig with a simulation of the user's own."""
