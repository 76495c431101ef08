"""Code shared by the benchmarks: figures, processes of servers and Ray nodes, progress, machine, example data."""
