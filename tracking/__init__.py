"""From tracked markers to the inputs of a vehicle's model: the motion of its wings, and the forces in free flight.

SI units, radians. Body axes: x forward to the nose, y to the right, z down; tracking axes: z up (docs/tracking.md).
"""
