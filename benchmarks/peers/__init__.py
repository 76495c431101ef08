"""The same wing in other engines: independently written equations for scipy, and Exudyn."""
