"""``wingfit import``."""
