"""What recordings that have not been made will say: how they are sampled, their noise, and changes by parameters."""
