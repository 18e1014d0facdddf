"""Inputs of experiments: multisines, sweeps, doublets, multisteps and binary sequences.

Each function returns `Signals`, which `mf.simulate`, `mf.MonteCarlo` and `mf.crlb` take as they are.
"""

from .multisines import multisine
from .signals import Signals
from .steps import doublet, multistep, prbs
from .sweeps import chirp

__all__ = ["Signals", "chirp", "doublet", "multisine", "multistep", "prbs"]
