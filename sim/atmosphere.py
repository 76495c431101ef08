"""Dry air as an ideal gas."""

from __future__ import annotations

SPECIFIC_GAS_CONSTANT = 287.05  # J/(kg K), dry air (ISO 2533)


def density(pressure: float, temperature: float) -> float:
    """Air density in kg/m^3 from static pressure (Pa) and temperature (K): rho = p / (R T)."""
    return pressure / (SPECIFIC_GAS_CONSTANT * temperature)
