"""Effects of the drive, its hinge and its rods."""
