"""The server: HTTP API, database, computation of jobs, web page."""
