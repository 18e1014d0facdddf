"""What is known of the measurement noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arguments import public, reals
from ..errors import SpecError

__all__ = ["Noise"]


@public
@dataclass(frozen=True, init=False, repr=False)
class Noise:
    """Measurement noise known up to a common factor: `mf.fit(rec, model, noise=mf.Noise(y=0.02, u=0.1))`.

    Parameters
    ----------
    y : float, sequence of float, (output, output) array, callable, or sequence of callable
        Standard deviations of the samples of the outputs, their covariance matrix, or power spectra:
        functions of omega (rad/s, array in, array out), one for all outputs or one per output, in units in
        which white noise of standard deviation s has the constant spectrum s².
    u : as `y`, optional
        Of the inputs; left out: they are exact.

    Raises
    ------
    SpecError
        Negative levels, or a matrix that is no covariance.

    See Also
    --------
    modfun.fit : Takes it as `noise`.
    modfun.crlb : Takes it as `sigma`.

    Notes
    -----
    Ratios are what an estimate depends on. The common factor is estimated too, and scales the standard
    errors; `fit.check()` says where it is far from one.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.4.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([[[1, 2]], [[0.5]]], [1, 1.2, 4])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=20.0, intervals=500, nsr=0.05, seed=0)
    >>> known = mf.Noise(y=[0.04, 0.01])
    >>> structure = mf.TransferFunction(poles=2, zeros=[[1], [0]], denominator="common")
    >>> fit = mf.fit(rec, structure, noise=known)
    >>> fit.status
    'ok'
    """

    y: Any
    u: Any

    def __init__(self, y: Any = 1.0, u: Any = None) -> None:
        object.__setattr__(self, "y", _given("y", y))
        object.__setattr__(self, "u", None if u is None else _given("u", u))

    @property
    def white(self) -> bool:
        """Whether all levels are numbers; else some are spectra."""
        given = [
            one for level in (self.y, self.u) for one in (level if isinstance(level, tuple) else (level,))
        ]
        return not any(callable(one) for one in given)

    def __repr__(self) -> str:
        words = f"y={_plain(self.y)!r}" + ("" if self.u is None else f", u={_plain(self.u)!r}")
        return f"Noise({words})"


def _plain(given: Any) -> Any:
    return [_plain(one) for one in given] if isinstance(given, tuple) else given


def _given(name: str, given: Any) -> Any:
    """Numbers, tuples of them, tuples of tuples, or callables."""
    if callable(given):
        return given
    if isinstance(given, Sequence) and not isinstance(given, str) and any(callable(one) for one in given):
        if not all(callable(one) for one in given):
            raise SpecError(f"Noise: {name}={given!r} mixes functions and numbers; give a function a channel")
        return tuple(given)
    values = reals("Noise", name, given)
    if values.ndim > 2 or not values.size or not np.all(np.isfinite(values)):
        raise SpecError(
            f"Noise: {name}={given!r} must be standard deviations, a covariance matrix, or functions of omega"
        )
    if values.ndim == 2:
        if values.shape[0] != values.shape[1] or not np.allclose(values, values.T, rtol=1e-9, atol=0):
            raise SpecError(
                f"Noise: {name} of shape {values.shape} is not a covariance matrix: it must be symmetric"
            )
        least = 1e-12 if name == "y" else -1e-12
        if np.min(np.linalg.eigvalsh(values)) < least * np.max(np.diag(values)):
            raise SpecError(
                f"Noise: {name} is not a covariance matrix: it has a negative eigenvalue, or is singular"
            )
        return tuple(map(tuple, values.tolist()))
    if np.any(values < 0) or (name == "y" and np.any(values == 0)):
        raise SpecError(f"Noise: {name}={given!r} holds a standard deviation that is not above 0")
    return float(values) if values.ndim == 0 else tuple(values.tolist())
