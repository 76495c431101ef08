"""Malformed and hostile requests: tests that the server refuses them, keeps running, and uses little memory."""
