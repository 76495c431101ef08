"""Estimation that knows neither wings nor effects: derivatives, bounded least squares, score tests, noise models."""
