"""Compiled functions of exported models, which are cached by the source of this folder."""
