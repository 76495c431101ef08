"""The same evaluations in-process, on a process pool and on Ray; job states without I/O."""
