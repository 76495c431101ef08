"""Tests of plans of experiments."""
