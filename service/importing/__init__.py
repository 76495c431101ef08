"""Import of tracks from files of tracking systems, over HTTP."""
