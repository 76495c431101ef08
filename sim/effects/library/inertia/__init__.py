"""Effects of inertia: masses that the description does not contain."""
