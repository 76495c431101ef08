"""Load test of the server: reads and event streams during a calibration, with a database as after years of use."""
