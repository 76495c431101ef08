"""Import of tracks on a server: types of the answers, and methods of the client."""
