"""``wingfit track`` and ``wingfit cameras``."""
