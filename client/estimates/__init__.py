"""How well genes are known."""
