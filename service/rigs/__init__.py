"""Rigs that users simulate themselves: what a job stores of one, and simulations that drivers compute for a job."""
