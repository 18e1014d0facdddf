"""What follows from the parameters, with standard errors by the delta method."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..base.student import root
from ..base.tables import Table
from ..errors import SpecError
from ..language.evaluate import function_of
from ..systems.polynomials import root_slopes

if TYPE_CHECKING:
    from .fit import Fit

__all__ = [
    "cancelling",
    "damp",
    "denominators",
    "derived",
    "frequency_response",
    "poles",
    "root_gradients",
]

F64 = NDArray[np.float64]
C128 = NDArray[np.complex128]


def derived(fit: Fit, expressions: Mapping[str, str | Callable[[Mapping[str, float]], float]]) -> Table:
    """Table of functions of the parameters; see `Fit.derived`."""
    if not expressions:
        raise SpecError('derived: give name=expression, as fit.derived(wn="sqrt(a2)")')
    values, errors = [], []
    for name, given in expressions.items():
        function = _function(name, given, fit.param_names)
        value, gradient = _gradient(name, function, fit)
        values.append(value)
        errors.append(float(root(gradient @ fit.cov_params() @ gradient)))
    low, high = fit.interval(np.array(values), np.array(errors))
    return Table({"name": list(expressions), "value": values, "bse": errors, "low": low, "high": high})


def _function(name: str, given: Any, names: Sequence[str]) -> Callable[[Mapping[str, float]], float]:
    if isinstance(given, str):
        # A name such as b0[q,de] is no word of the language: it is read under one that is.
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


def _gradient(name: str, function: Callable[[Mapping[str, float]], float], fit: Fit) -> tuple[float, F64]:
    """Value and central differences, with steps that suit the size of each parameter and its error."""
    names, params = fit.param_names, fit.params

    def at(theta: F64) -> float:
        return function(dict(zip(names, theta.tolist(), strict=True)))

    value = at(params)
    if not np.isfinite(value):
        raise SpecError(
            f"derived: {name} is {value} at the estimate {fit.estimates()}; it must have a finite value there"
        )
    gradient = np.empty(params.size)
    for i in range(params.size):
        step = np.zeros(params.size)
        scale = max(abs(params[i]), float(np.nan_to_num(fit.bse[i]))) or 1.0
        step[i] = np.cbrt(np.finfo(float).eps) * scale
        gradient[i] = (at(params + step) - at(params - step)) / (2 * step[i])
    return value, gradient


def poles(fit: Fit, output: int = 0) -> tuple[C128, C128]:
    """Poles of an output and their derivatives (pole, parameter)."""
    den, _ = fit.polynomials(output)
    first = fit.layout.places[0][output]
    places = fit.layout.positions[first : first + den.size - 1]
    return root_gradients(den, [None, *places], fit.params.size)


def root_gradients(p: F64, places: Sequence[int | None], size: int) -> tuple[C128, C128]:
    """Roots and their derivatives (root, parameter); `places`: which of so many parameters each coefficient
    is, None where it is none."""
    found, slopes = root_slopes(p)
    gradient = np.zeros((found.size, size), complex)
    for k, at in enumerate(places):
        if at is not None:
            gradient[:, at] = slopes[:, k]
    return found, gradient


def cancelling(fit: Fit, theta: F64, cov: F64) -> float:
    """Standard errors between the pole and the zero that are nearest to cancelling, in every path.

    Parameters
    ----------
    fit : Fit
        Whose structure it is.
    theta : (p,) array
    cov : (p, p) array

    Returns
    -------
    float
        sqrt(d' C^-1 d), d the distance of the two in the plane (on the axis where both are real) and C its
        covariance; inf where a path has no zeros.
    """
    den, nums = fit.layout.polynomials(theta)
    degrees = fit.layout.numerators[0]
    ends = np.cumsum([fit.order, *(0 if d is None else d + 1 for d in degrees)])
    found = _roots(den, [None, *range(fit.order)], theta.size)
    paths = [
        _roots(num, range(at, at + num.size), theta.size)
        for num, at, d in zip(nums, ends[:-1].tolist(), degrees, strict=True)
        if d is not None
    ]
    apart = [max((_nearest(pole, path, cov) for path in paths), default=np.inf) for pole in found]
    return min(apart, default=np.inf)


Root = tuple[complex, C128]


def _roots(p: F64, places: Sequence[int | None], size: int) -> list[Root]:
    return list(zip(*root_gradients(p, places, size), strict=True))


def _nearest(pole: Root, zeros: list[Root], cov: F64) -> float:
    distances = [np.inf]
    for zero, gradient in zeros:
        apart, slope = pole[0] - zero, pole[1] - gradient
        plane = np.array([slope.real, slope.imag])[: 1 if pole[0].imag == zero.imag == 0 else 2]
        d = np.array([apart.real, apart.imag])[: len(plane)]
        spread = plane @ cov @ plane.T
        if np.all(np.isfinite(spread)) and np.linalg.det(spread) > 0:
            distances.append(float(np.sqrt(d @ np.linalg.solve(spread, d))))
    return min(distances)


def denominators(fit: Fit) -> list[tuple[str, int]]:
    """Name and number of an output for each denominator of its own; the name is empty if there is one."""
    if fit.layout.common:
        return [("", 0)]
    return [(name, i) for i, name in enumerate(fit.outputs)]


def damp(fit: Fit) -> Table:
    """Poles, natural frequencies, damping, time constants; see `Fit.damp`."""
    every = denominators(fit)
    if len(every) == 1:
        return Table(_damped(fit, 0))
    columns: dict[str, list[Any]] = {"output": []}
    for name, i in every:
        own = _damped(fit, i)
        columns["output"] += [name] * len(own["pole"])
        for key, values in own.items():
            columns.setdefault(key, []).extend(values)
    return Table(columns)


def _damped(fit: Fit, output: int) -> dict[str, list[Any]]:
    found, gradients = fit._poles(output)
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


def frequency_response(fit: Fit, omega: F64) -> tuple[C128, C128]:
    """Response (output, input, f) and gradient (p, output, input, f); see `Fit.frequency_response`."""
    layout = fit.layout
    outputs, inputs = len(layout.outputs), len(layout.inputs)
    s = 1j * omega
    response = np.zeros((outputs, inputs, s.size), complex)
    gradient = np.zeros((fit.params.size, outputs, inputs, s.size), complex)
    delays = {path: len(layout.free) + at for at, path in enumerate(layout.free_delays)}
    with np.errstate(all="ignore"):
        for i in range(outputs):
            den, nums = fit.polynomials(i)
            n, first = layout.orders[i], layout.places[0][i]
            over = 1 / np.polyval(den, s)
            for k, (num, delay) in enumerate(zip(nums, layout.delays(fit.params, i), strict=True)):
                degree = layout.numerators[i][k]
                if degree is None:
                    continue
                late = np.exp(-s * delay)
                response[i, k] = np.polyval(num, s) * over * late
                for j in range(1, n + 1):
                    at = layout.positions[first + j - 1]
                    if at is not None:
                        gradient[at, i, k] = -response[i, k] * s ** (n - j) * over
                for j in range(degree + 1):
                    at = layout.positions[layout.places[1][i][k] + j]
                    if at is not None:
                        gradient[at, i, k] = s ** (degree - j) * over * late
                path = layout.routes[i][k]
                if path in delays:
                    gradient[delays[path], i, k] = -s * response[i, k]
    return response, gradient
