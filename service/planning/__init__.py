"""Plans of experiments over HTTP."""
