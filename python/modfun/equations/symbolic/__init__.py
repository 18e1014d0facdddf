"""Equations as text: what SymPy is needed for (extra ``symbolic``)."""
