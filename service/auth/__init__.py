"""API keys: who calls, what a key permits, and the audit log."""
