"""Simulations that share no code with the tool, and the cameras and balances that record them."""
