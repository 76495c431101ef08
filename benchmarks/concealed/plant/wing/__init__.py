"""The flexible wing: cut into rigid bodies, joined, integrated to a periodic motion."""
