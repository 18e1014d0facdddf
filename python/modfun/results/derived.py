"""What follows from the parameters, with standard errors by the delta method."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import C128, F64
from ..base.samples import frequencies
from ..base.student import root
from ..base.tables import Table
from ..errors import SpecError
from ..language.evaluate import function_of
from ..systems.polynomials import roots
from .estimates import Estimates
from .gradients import differences, root_gradients

__all__ = ["as_function", "bode", "cancelling", "damp", "derived", "gain_errors", "stable"]

UNITS = dict.fromkeys(("pole", "omega", "omega_bse"), "rad/s") | dict.fromkeys(
    ("time_constant", "time_constant_bse"), "s"
)

FREQUENCIES, LOWEST = 50, 1e3  # of a Bode diagram, and the highest one over the lowest, at most
Roots = tuple[C128, C128]  # and their derivatives (root, parameter)


def stable(fit: Estimates) -> bool:
    """Whether all poles of a transfer function are stable."""
    return all(np.all(roots(den).real < 0) for den in map(np.array, fit.layout.denominators(fit.params)))


def derived(fit: Estimates, expressions: Mapping[str, str | Callable[[Mapping[str, float]], float]]) -> Table:
    """Table of functions of the parameters; see `Fit.derived`."""
    if not expressions:
        raise SpecError('derived: give name=expression, as fit.derived(wn="sqrt(a2)")')
    values, errors, degrees = [], [], []
    for name, given in expressions.items():
        function = as_function(name, given, fit.param_names)
        value, gradient = _gradient(name, function, fit)
        values.append(value)
        degrees.append(fit._fewest_degrees(gradient != 0))
        bound = any(gradient[fit.param_names.index(own)] != 0 for own in fit.at_bound)  # its error is unknown
        errors.append(np.nan if bound else float(root(gradient @ fit.cov_params() @ gradient)))
    low, high = fit.interval(np.array(values), np.array(errors), degrees=np.array(degrees))
    return Table({"name": list(expressions), "value": values, "bse": errors, "low": low, "high": high})


def as_function(name: str, given: Any, names: Sequence[str]) -> Callable[[Mapping[str, float]], float]:
    """What a user gave under a name, an expression or a function of a mapping, as the latter."""
    if isinstance(given, str):
        # A name such as b0[q,de] is not a word of the language: it is read under one that is.
        words = {name: f"p{k}_" for k, name in enumerate(names) if not name.isidentifier() and name in given}
        if not words:
            return function_of(given, names)
        for own, word in words.items():
            given = given.replace(own, word)
        read = function_of(given, [words.get(name, name) for name in names])
        return lambda values: read({words.get(own, own): value for own, value in values.items()})
    if callable(given):
        return lambda values: _called(name, given, values)
    raise SpecError(f"derived: {name}={given!r} must be an expression as text, or a function of a mapping")


def _called(name: str, function: Callable[..., Any], values: Mapping[str, float]) -> float:
    try:
        return float(function(values))
    except Exception as error:
        raise SpecError(f"derived: {name} raised {type(error).__name__}: {error}") from error


def _gradient(
    name: str, function: Callable[[Mapping[str, float]], float], fit: Estimates
) -> tuple[float, F64]:
    """Value at the estimate, and its derivatives."""

    def at(theta: F64) -> float:
        return function(dict(zip(fit.param_names, theta.tolist(), strict=True)))

    value = at(fit.params)
    if not np.isfinite(value):
        raise SpecError(
            f"derived: {name} is {value} at the estimate {fit.estimates()}; it must have a finite value there"
        )
    return value, differences(at, fit.params, fit.bse)


def cancelling(fit: Estimates, theta: F64, cov: F64) -> float:
    """Standard errors between the pole and the zero that are nearest to cancelling, in every path.

    Parameters
    ----------
    fit : Estimates
        Whose structure it is.
    theta : (p,) array
    cov : (p, p) array

    Returns
    -------
    float
        sqrt(d' C^-1 d), d the distance of the two in the plane (on the axis where both are real) and C its
        covariance; inf where a path has no zeros.
    """
    degrees = fit.layout.numerators[0]
    if not fit.order or min((d for d in degrees if d is not None), default=0) == 0:
        return np.inf
    den, nums = fit.layout.polynomials(theta)
    ends = np.cumsum([fit.order, *(0 if d is None else d + 1 for d in degrees)])
    free = fit.layout.positions  # None of what is held
    poles = root_gradients(den, [None, *free[: fit.order]], theta.size)
    paths = [
        _nearest(poles, root_gradients(num, free[at : at + num.size], theta.size), cov)
        for num, at, d in zip(nums, ends[:-1].tolist(), degrees, strict=True)
        if d is not None
    ]
    return float(np.min(np.max(paths, axis=0)))


def _nearest(poles: Roots, zeros: Roots, cov: F64) -> F64:
    """Standard errors from each pole to the nearest zero."""
    d = poles[0][:, None] - zeros[0]
    slope = poles[1][:, None] - zeros[1]
    x, y = slope.real, slope.imag
    with np.errstate(all="ignore"):  # repeated roots have no derivatives
        xx, xy, yy = (np.sum((a @ cov) * b, axis=-1) for a, b in ((x, x), (x, y), (y, y)))
        det = xx * yy - xy**2
        plane = (yy * d.real**2 - 2 * xy * d.real * d.imag + xx * d.imag**2) / det
        axis = d.real**2 / xx
    real = (poles[0].imag == 0)[:, None] & (zeros[0].imag == 0)
    known = np.where(real, xx > 0, det > 0) & np.isfinite(xx + xy + yy)
    squares = np.where(known, np.maximum(np.where(real, axis, plane), 0.0), np.inf)
    return np.asarray(np.sqrt(np.min(squares, axis=1, initial=np.inf)))


def gain_errors(fit: Estimates, omega: F64) -> tuple[C128, F64, F64]:
    """Gains (output, input, omega), relative standard errors of their size, and those of their angle."""
    fit.need_numbers("frequency_response")
    response, gradient = fit.response_gradients(omega)
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = gradient / response
        size, angle = (
            root(np.einsum("piku,pq,qiku->iku", part, fit.cov_params(), part, optimize=True))
            for part in (relative.real, relative.imag)
        )
    return response, size, angle


def bode(fit: Estimates, omega: ArrayLike | None) -> Table:
    """Table of a Bode diagram; see `Fit.bode`."""
    if omega is None:
        low, high = fit.band
        omega = np.geomspace(max(low, min(fit.omega0, default=low), high / LOWEST), high, FREQUENCIES)
    at = frequencies(omega, "bode")
    response, size, angle = gain_errors(fit, at)
    paths = [(int(i), int(k)) for i, k in np.argwhere(np.any(response != 0, axis=2))]
    columns: dict[str, Any] = {}
    if response.shape[:2] != (1, 1):
        columns["output"] = [fit.outputs[i] for i, _ in paths for _ in at]
        columns["input"] = [fit.inputs[k] for _, k in paths for _ in at]
    columns["omega"] = np.tile(at, len(paths))
    where = tuple(np.array(paths, dtype=int).reshape(-1, 2).T)
    gains = response[where]
    with np.errstate(divide="ignore"):
        columns["magnitude_db"] = 20 * np.log10(np.abs(gains)).ravel()
    columns["magnitude_bse"] = 20 / np.log(10) * size[where].ravel()
    columns["phase_deg"] = np.degrees(np.unwrap(np.angle(gains), axis=1)).ravel()
    columns["phase_bse"] = np.degrees(angle[where]).ravel()
    units = {
        "omega": "rad/s",
        "magnitude_db": "dB",
        "magnitude_bse": "dB",
        "phase_deg": "°",
        "phase_bse": "°",
    }
    return Table(columns, units=units)


def damp(fit: Estimates) -> Table:
    """Poles, natural frequencies, damping, time constants; see `Fit.damp`."""
    every = fit.denominators()
    if len(every) == 1:
        return Table(_damped(fit, 0), units=UNITS)
    columns: dict[str, list[Any]] = {"output": []}
    for name, i in every:
        own = _damped(fit, i)
        columns["output"] += [name] * len(own["pole"])
        for key, values in own.items():
            columns.setdefault(key, []).extend(values)
    return Table(columns, units=UNITS)


def _damped(fit: Estimates, output: int) -> dict[str, list[Any]]:
    found, gradients = fit.pole_gradients(output)
    cov = fit.cov_params()
    columns: dict[str, list[Any]] = {
        name: []
        for name in ("pole", "omega", "omega_bse", "zeta", "zeta_bse", "time_constant", "time_constant_bse")
    }

    def error(gradient: F64) -> float:
        if not np.all(np.isfinite(gradient)):
            return float("nan")  # a repeated pole: its derivative is infinite
        return float(root(gradient @ cov @ gradient))

    for pole, gradient in zip(found, gradients, strict=True):
        if pole.imag < 0:
            continue
        size = abs(pole)
        if pole.imag == 0:
            lasting = np.inf if pole.real == 0 else -1 / pole.real
            zeta = -float(np.sign(pole.real))
            row = [complex(pole), size, error(gradient.real), zeta, None, float(lasting)]
            row.append(error(gradient.real * lasting**2) if np.isfinite(lasting) else None)
        else:
            omega = (pole.conjugate() * gradient).real / size
            zeta = -pole.real / size
            row = [
                complex(pole),
                size,
                error(omega),
                zeta,
                error(-(gradient.real + zeta * omega) / size),
                None,
                None,
            ]
        for column, value in zip(columns.values(), row, strict=True):
            column.append(value)
    return columns
