"""The Python client of the server. It needs neither the web framework nor the simulator."""
