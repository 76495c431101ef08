"""Shared by several benchmarks: machine, files, jobs, progress, servers and Ray nodes as processes, figures."""
