"""Samples of experiments and where they come from."""
