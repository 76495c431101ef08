"""Small campaigns, and a demonstration that calibrates one of them over HTTP."""
