"""``wingfit plan``."""
