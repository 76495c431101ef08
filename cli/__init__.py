"""The commands of ``wingfit``, one module for each command or group of commands."""
