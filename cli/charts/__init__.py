"""Charts of runs and diagnoses in the terminal."""
