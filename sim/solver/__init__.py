"""From initial conditions to a periodic beat of stated accuracy, for a batch of individuals."""
