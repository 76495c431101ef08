"""Where an effect may act: on a wing, on a vehicle, or on an observation."""
