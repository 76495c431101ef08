"""wingfit."""
