"""Parts of several benchmarks: the machine, servers as processes, Ray nodes, figures."""
