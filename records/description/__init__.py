"""The file ``dataset.yaml``: pydantic models of its keys, conversion of units, checks, and its JSON Schema."""
