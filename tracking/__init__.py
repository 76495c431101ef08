"""Estimates of the inputs of a vehicle's model from tracked markers: motion of the wings, and forces in free flight.

SI units, radians. Body axes: x forward to the nose, y to the right, z down; tracking axes: z up (docs/tracking.md).
"""
