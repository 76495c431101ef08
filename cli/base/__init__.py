"""What all commands share: options, tables, numbers, progress, files."""
