"""Estimates while samples arrive."""
