"""Schema changes, applied at start-up in the order of their revisions."""
