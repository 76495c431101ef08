"""The two stories that began the project, played from concealed data to the report: ``python -m benchmarks.proof``."""
