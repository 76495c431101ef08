"""Simulated rigs that share no code with the product, and the cameras and balances that record them."""
