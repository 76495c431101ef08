"""Changes of the database schema, made when the server starts, in the order of their revisions."""
