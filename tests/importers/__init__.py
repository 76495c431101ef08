"""The importers read what other programs write, guess nothing, and refuse the rest with a remedy."""
