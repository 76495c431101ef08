"""Plans of experiments: the answer of the server, and the method of the client."""
