"""The same wing in other engines: an independent right-hand side for scipy, and Exudyn."""
