"""The same wing simulated by other software: scipy with independently written equations, and Exudyn."""
