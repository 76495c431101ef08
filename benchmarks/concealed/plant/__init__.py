"""The plant: simulated rigs that share no code with the product's simulator, with simulated cameras and a balance."""
