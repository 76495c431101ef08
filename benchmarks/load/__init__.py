"""Load: reads, event streams and pages beside a calibration, over a database as after years of use."""
