"""Estimation methods that do not depend on the simulator: derivatives, least squares, score tests, noise models."""
