"""The server: HTTP API, database, computation of jobs (runs and diagnoses), web page."""
