"""API keys: the caller of a request, the scopes of a key, and the audit log."""
