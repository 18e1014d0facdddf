"""Slow, plain NumPy/SciPy twins of the numerical core, written from the formulas.

They never import the package under test and share no code with it; the tests hold the core against them.
"""
