"""Simulators: rig, genome, condition and effects -> simulated observation."""
