"""Words that options and results of every room have in common."""

from __future__ import annotations

__all__ = ["INTERSAMPLE", "STATUS", "TRENDS", "USABLE"]

# What an input does between samples.
INTERSAMPLE = ("smooth", "zoh", "foh")
# What is fitted beside a model; the position is the number of unknowns, a row of the model.
TRENDS = (None, "constant", "linear")
# How a fit ended, in the order of the core's numbers.
STATUS = ("ok", "maxiter", "rank", "nonfinite")
# Of these, with an estimate.
USABLE = STATUS[:2]
