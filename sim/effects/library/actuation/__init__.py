"""Effects of the actuation: the drive, its hinge and its rods."""
