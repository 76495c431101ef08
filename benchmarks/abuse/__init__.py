"""Malformed and hostile requests: the server refuses them in words, lives on, and spends no memory on them."""
