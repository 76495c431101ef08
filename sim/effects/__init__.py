"""Effects: physics and measurement faults that a recording may contain and a model may be missing.

Each effect has a file in ``library``; ``contract`` defines what it declares.
"""
