"""The flapping vehicle, by blade elements, and what can be hidden in it."""
