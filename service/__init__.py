"""HTTP, database, command line, Python client, web page."""
