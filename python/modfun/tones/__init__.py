"""Sinusoids in noise."""
