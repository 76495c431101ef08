"""Blade-element simulation of a flapping vehicle, with the effects that can be hidden in it."""
