"""The layout of ``dataset.yaml``: its models, units and checks, and its JSON Schema."""
