"""Effects of the structure: stiffness, play and damping of the wing."""
