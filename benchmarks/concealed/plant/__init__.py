"""The plant: simulated rigs, cameras and balance that share no code with ``wingfit.sim``, the tested simulator."""
