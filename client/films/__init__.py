"""Films of wings and the tracking of their markers, as the client sees them."""
