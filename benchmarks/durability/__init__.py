"""Tests that the server loses nothing it acknowledged when it is killed, and that runs end with the same results."""
