"""What a dataset holds, as the client sees it: the described wing, its tracks, forces, and the checks."""
