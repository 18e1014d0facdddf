"""Systems of python-control and scipy.signal, there and back; neither is imported to read one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.optional import optional
from ..errors import SpecError
from .lti import LTI, ss, tf

__all__ = ["system_of", "to_control", "to_scipy"]


def system_of(given: Any, delay: float | Sequence[float]) -> LTI:
    """Return a system of python-control or SciPy as an LTI, by what it has rather than by its class."""
    if isinstance(given, LTI):
        if not np.any(delay):
            return given
        if any(given.delays):
            raise SpecError(f"mf.tf: the system has delays {given.delays} s of its own; leave delay= out")
        if given.matrices is not None:
            return ss(*given.matrices, delay=delay)
        return tf(given.numerators, given.denominators, delay=delay)
    if hasattr(given, "frdata") or hasattr(given, "omega"):
        raise SpecError(
            "mf.tf: this is a frequency response, which has no polynomials; it is data: "
            "mf.FrequencyResponse(omega=..., response=...)"
        )
    if getattr(given, "dt", None) not in (None, 0):
        raise SpecError(
            f"mf.tf: the system is discrete in time (dt = {given.dt}); convert it to continuous time first"
        )
    if all(hasattr(given, name) for name in "ABCD"):
        return ss(given.A, given.B, given.C, given.D, delay=delay)
    if hasattr(given, "num_list") and hasattr(given, "den_list"):
        return tf(given.num_list, given.den_list, delay=delay)
    if hasattr(given, "num") and hasattr(given, "den"):
        num: Any = given.num
        if np.ndim(given.den) == 1 and isinstance(num, np.ndarray) and num.ndim == 2:
            num = [[row] for row in num]  # SciPy: one input, several outputs
        return tf(num, given.den, delay=delay)
    if hasattr(given, "to_tf"):
        return system_of(given.to_tf(), delay)
    raise SpecError(
        f"mf.tf: got only {type(given).__name__}; give num and den, or a system of python-control or SciPy"
    )


def to_control(system: LTI, pade: int | None) -> Any:
    """Return what `LTI.to_control` promises."""
    control = optional("control", "control", "LTI.to_control")
    late = any(system.delays)
    if late and pade is None:
        raise SpecError(
            f"to_control: delays {system.delays} s have no rational form; give pade=, an order such as 3"
        )
    if pade is not None and not (isinstance(pade, int | np.integer) and pade >= 1):
        raise SpecError(f"to_control: pade={pade!r} must be a whole number, at least 1")
    if system.matrices is not None:
        plain = control.ss(*system.matrices, 0)
        if not late:
            return plain
        return plain * control.append(
            *(control.ss(control.tf(*control.pade(d, pade))) for d in system.delays)
        )
    num, den = system.polynomials()
    wait = [control.pade(d, pade) if d else ([1.0], [1.0]) for d in system.delays]
    nums = [[np.polymul(n, w[0]) for n, w in zip(row, wait, strict=True)] for row in num]
    dens = [[np.polymul(d, w[1]) for d, w in zip(row, wait, strict=True)] for row in den]
    return control.tf(nums, dens, 0)


def to_scipy(system: LTI) -> Any:
    """Return what `LTI.to_scipy` promises."""
    from scipy import signal

    if any(system.delays):
        raise SpecError(
            f"to_scipy: SciPy's systems have no delay and this one has {system.delays} s; "
            "use to_control(pade=…), or make the system without delay"
        )
    if system.matrices is not None:
        return signal.StateSpace(*system.matrices)
    if system.shape == (1, 1):
        return signal.TransferFunction(system.num, system.den)
    return signal.StateSpace(system.A, system.B, system.C, system.D)
