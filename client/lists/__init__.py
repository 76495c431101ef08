"""Lists of datasets, runs and diagnoses, and changes of their names and notes."""
