"""Renders videos of a wing with markers; the truth is kept beside them."""
