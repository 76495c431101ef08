"""A second plant, of another kind than the bodies and springs of ``wing``: the wing as a geometrically exact rod."""
