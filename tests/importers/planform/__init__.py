"""Wings described by outlines."""
