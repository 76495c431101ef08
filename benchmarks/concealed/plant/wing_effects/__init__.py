"""What can be hidden in the wing, its drive and the air."""
