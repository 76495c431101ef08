"""Simulation of a flapping pair of wings by an unsteady vortex lattice, with hidden changes of motion and stream."""
