"""Systems as objects of python-control and scipy.signal; neither is imported before."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.optional import optional
from ..errors import SpecError
from .polynomials import Polynomials

__all__ = ["matrices_to_control", "polynomials_to_control", "to_scipy"]


def matrices_to_control(matrices: Sequence[Any], delays: Sequence[float], pade: int | None) -> Any:
    """A `control.StateSpace`; see `LTI.to_control`."""
    control = _control(delays, pade)
    system = control.ss(*matrices, 0)
    if not any(delays):
        return system
    return system * control.append(*(control.ss(control.tf(*control.pade(d, pade))) for d in delays))


def polynomials_to_control(
    num: Polynomials, den: Polynomials, delays: Sequence[float], pade: int | None
) -> Any:
    """A `control.TransferFunction`; see `LTI.to_control`."""
    control = _control(delays, pade)
    wait = [control.pade(d, pade) if d else ([1.0], [1.0]) for d in delays]
    nums = [[np.polymul(n, w[0]) for n, w in zip(row, wait, strict=True)] for row in num]
    dens = [[np.polymul(d, w[1]) for d, w in zip(row, wait, strict=True)] for row in den]
    return control.tf(nums, dens, 0)


def _control(delays: Sequence[float], pade: int | None) -> Any:
    """python-control, once the order of the Padé approximation is checked."""
    control = optional("control", "control", "LTI.to_control")
    if any(delays) and pade is None:
        raise SpecError(
            f"to_control: delays {delays} s have no rational form; give pade=, an order such as 3"
        )
    if pade is not None and not (isinstance(pade, int | np.integer) and pade >= 1):
        raise SpecError(f"to_control: pade={pade!r} must be a whole number, at least 1")
    return control


def to_scipy(parts: Sequence[Any], delays: Sequence[float]) -> Any:
    """A `scipy.signal.lti` of (numerator, denominator) or (A, B, C, D); see `LTI.to_scipy`."""
    from scipy import signal

    if any(delays):
        raise SpecError(
            f"to_scipy: SciPy's systems have no delay and this one has {delays} s; "
            "use to_control(pade=…), or make the system without delay"
        )
    return signal.lti(*parts)
