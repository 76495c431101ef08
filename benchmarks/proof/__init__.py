"""The two case studies that motivated the project, from concealed data to the report.

``python -m benchmarks.proof``.
"""
