"""Independent simulation of a flexible wing: rigid bodies joined by springs, integrated to a periodic motion."""
