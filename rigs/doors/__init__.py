"""Doors to simulators that are not Python functions: a program, a UM-Bridge server, an FMU.

Each module has one function that returns a :data:`wingfit.rigs.rig.Simulate`, which can be pickled: every process opens
a connection, program or instance of its own when it first simulates.
"""
