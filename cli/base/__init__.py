"""Functions for all commands: options, tables, numbers, progress, files."""
