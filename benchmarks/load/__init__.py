"""Reads, watchers and pages beside a calibration, over a database that has seen years of use."""
