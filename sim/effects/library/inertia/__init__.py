"""Effects of inertia: masses that the description lacks."""
