"""The commands of ``wingfit``, one module per noun."""
