"""From fitted hypotheses to probabilities, a verdict, its validation, and the next experiment."""
