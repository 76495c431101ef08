"""Physics and measurement faults that a recording may contain and a model may lack: one file each, and a contract."""
