"""Systems as objects of python-control and scipy.signal; neither is imported before."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.optional import optional
from ..errors import SpecError
from .polynomials import Polynomials

__all__ = ["labelled", "matrices_to_control", "polynomials_to_control", "refuse_late", "to_scipy"]


def matrices_to_control(matrices: Sequence[Any], delays: Sequence[float], pade: int | None) -> Any:
    """A `control.StateSpace`; see `LTI.to_control`."""
    control = _control(delays, pade)
    system = control.ss(*matrices, 0)
    if not any(delays):
        return system
    return system * control.append(*(control.ss(control.tf(*control.pade(d, pade))) for d in delays))


def polynomials_to_control(num: Polynomials, den: Polynomials, delays: Any, pade: int | None) -> Any:
    """A `control.TransferFunction`; see `LTI.to_control`."""
    control = _control(delays, pade)
    table = np.broadcast_to(delays, (len(num), len(num[0]))).tolist()
    nums, dens = [], []
    for tops, bottoms, late in zip(num, den, table, strict=True):
        wait = [control.pade(d, pade) if d else ([1.0], [1.0]) for d in late]
        nums.append([np.polymul(n, w[0]) for n, w in zip(tops, wait, strict=True)])
        dens.append([np.polymul(d, w[1]) for d, w in zip(bottoms, wait, strict=True)])
    return control.tf(nums, dens, 0)


def labelled(made: Any, inputs: Sequence[str] | None, outputs: Sequence[str] | None) -> Any:
    """A system of python-control with the names that channels have."""
    if inputs is not None:
        made.set_inputs(list(inputs))
    if outputs is not None:
        made.set_outputs(list(outputs))
    return made


def _control(delays: Any, pade: int | None) -> Any:
    """python-control, once the order of the Padé approximation is checked."""
    control = optional("control", "control", "LTI.to_control")
    if np.any(delays) and pade is None:
        raise SpecError(
            f"to_control: delays {delays} s have no rational form; give pade=, an order such as 3"
        )
    if pade is not None and not (isinstance(pade, int | np.integer) and pade >= 1):
        raise SpecError(f"to_control: pade={pade!r} must be a whole number, at least 1")
    return control


def refuse_late(delays: Any) -> None:
    """Refuse delays, which SciPy's systems have none of."""
    if np.any(delays):
        raise SpecError(
            f"to_scipy: SciPy's systems have no delay and this one has {delays} s; "
            "use to_control(pade=…), or make the system without delay"
        )


def to_scipy(parts: Sequence[Any]) -> Any:
    """A `scipy.signal.lti` of (numerator, denominator) or (A, B, C, D); see `LTI.to_scipy`."""
    from scipy import signal

    return signal.lti(*parts)
