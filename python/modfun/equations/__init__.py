"""Models written as equations; SymPy is used here only."""
