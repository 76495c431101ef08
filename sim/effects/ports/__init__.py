"""What an effect may change: the input of a wing or vehicle simulation, or an observation."""
