"""``wingfit align``."""
