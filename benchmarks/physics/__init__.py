"""Measurements of the accuracy and cost of the simulator, with reference solutions to compare with."""
