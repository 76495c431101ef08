"""Exported models: agreement with wingfit itself, without wingfit, and coverage of their intervals."""
