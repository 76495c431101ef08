"""The two case studies that motivated the project: data with hidden physics are simulated, diagnosed and reported.

Run both with ``python -m benchmarks.proof``.
"""
