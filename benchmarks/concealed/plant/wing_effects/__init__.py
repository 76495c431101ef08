"""The effects that can be hidden in the simulated wing: in its structure, its drive and the air loads."""
