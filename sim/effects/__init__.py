"""Physics and measurement faults ("effects") that a recording may contain and a model may be missing: one file each."""
