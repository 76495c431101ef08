"""The physics that a recording may contain and a baseline model may lack: one file per effect, and a contract."""
