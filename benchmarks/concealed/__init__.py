"""Concealed trials: data with physics hidden in them, answers under seal, the diagnosis run as a user runs it."""
