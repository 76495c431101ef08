"""Routes that several kinds of resource share."""
