"""The flexible wing: from its description and a discretisation to bodies, connectors, tracks and loads."""
