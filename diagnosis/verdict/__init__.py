"""Weigh the fitted hypotheses, decide the verdict, validate it, and propose the next experiment."""
