"""Blind trials of the diagnosis on small rigs of other fields: a motor, a circuit, a heated block, two masses."""
