"""Simulated experiments, and how well they let parameters be found."""
