"""Discrete-time models of a record: output and derivatives, least squares, conversion to continuous time."""

from __future__ import annotations

from math import floor

import numpy as np

from ..base.arrays import F64
from ..base.least_squares import scaled_lstsq
from ..errors import FitError
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..systems.polynomials import companion
from .sensitivities import trend_rows

__all__ = ["Discrete", "stable"]


class Discrete:
    """y = (Σ B u + T δ)/F + trend with parameters f1 … fn, then the B, then T, then the trend."""

    def __init__(self, rec: Record, model: TransferFunction, transient: bool, trend: str | None) -> None:
        assert rec.dt is not None
        layout = model.plain_layout(rec.inputs, "rivals")
        self.n, self.dt, self.size = layout.orders[0], rec.dt, rec.intervals + 1
        self.names, self.degrees = layout.param_names, layout.numerators[0]
        delays = layout.delays(np.zeros(0))
        # Every regressor is a signal filtered by 1/F and shifted: (which signal, by how many samples).
        signals: list[F64] = []
        self.shifts: list[tuple[int, int]] = []
        for k, degree in enumerate(self.degrees):
            if degree is None:
                continue
            late = floor(delays[k] / rec.dt + 0.5)
            u = np.concatenate([np.zeros(min(late, self.size)), rec.u[k]])[: self.size]
            first = 0 if degree == self.n else 1
            self.shifts += [(len(signals), shift) for shift in range(first, self.n + 1)]
            signals.append(u)
        if transient:
            impulse = np.zeros(self.size)
            impulse[0] = 1.0
            self.shifts += [(len(signals), shift) for shift in range(self.n)]
            signals.append(impulse)
        self.signals = np.array(signals)
        self.extra = trend_rows(trend, self.size)

    def start(self, y: F64) -> F64:
        """ARX least squares on the samples that have a past."""
        n = self.n
        columns = [-_shifted(y, i) for i in range(1, n + 1)]
        columns += [_shifted(self.signals[k], shift) for k, shift in self.shifts]
        return scaled_lstsq(np.array([*columns, *self.extra]).T[n:], y[n:])

    def steiglitz_mcbride(self, f: F64, y: F64) -> F64:
        """Least squares with all signals filtered by the last 1/F."""
        from scipy.signal import lfilter

        den = np.concatenate([[1.0], stable(f)])
        filtered = lfilter([1.0], den, np.vstack([y, self.signals, self.extra]))
        columns = [-_shifted(filtered[0], i) for i in range(1, self.n + 1)]
        columns += [_shifted(filtered[1 + k], shift) for k, shift in self.shifts]
        return scaled_lstsq(np.array([*columns, *filtered[1 + len(self.signals) :]]).T, filtered[0])

    def search(self, y: F64) -> F64:
        """f1 … fn after ten steps of Steiglitz and McBride from ARX, the roots of F inside the circle."""
        f = self.start(y)[: self.n]
        for _ in range(10):
            f = self.steiglitz_mcbride(f, y)[: self.n]
        return stable(f)

    def completed(self, f: F64, y: F64) -> F64:
        """All parameters, those that enter linearly at their best for these f1 … fn."""
        x = np.zeros(self.n + len(self.shifts) + len(self.extra))
        x[: self.n] = f
        x[self.n :] = scaled_lstsq(self.output(x)[1][self.n :].T, y)
        return x

    def cost(self, x: F64, y: F64) -> float:
        """Sum of squared output errors; inf where it overflows."""
        value = float(np.sum((self.output(x)[0] - y) ** 2))
        return value if np.isfinite(value) else float("inf")

    def output(self, x: F64) -> tuple[F64, F64]:
        """Output and its derivatives, (parameter, time)."""
        from scipy.signal import lfilter

        n, stop = self.n, self.n + len(self.shifts)
        den = np.concatenate([[1.0], x[:n]])
        filtered = lfilter([1.0], den, self.signals)
        columns = np.array([_shifted(filtered[k], shift) for k, shift in self.shifts])
        y = x[n:stop] @ columns
        again = lfilter([1.0], den, y)
        first = np.array([-_shifted(again, i) for i in range(1, n + 1)])
        return y + x[stop:] @ self.extra, np.vstack([first, columns, self.extra])

    def continuous(self, x: F64, what: str) -> dict[str, float]:
        """Parameters in continuous time, the input taken as held between samples."""
        n = self.n
        z, vectors = np.linalg.eig(companion(np.append(1.0, x[:n])))
        scale = np.max(np.abs(z)) if n else 1.0
        for root in z:
            if abs(root.imag) <= 1e-12 * scale and root.real <= 0:
                raise FitError(
                    f"{what}: the discrete-time model has a pole at z = {root.real:.3g}, which no continuous-"
                    "time pole gives; sample faster, or lower poles="
                )
        if np.linalg.cond(vectors) > 1e10:
            raise FitError(
                f"{what}: the discrete-time model has (nearly) equal poles and cannot be converted; "
                "lower poles="
            )
        s = np.log(z.astype(np.complex128)) / self.dt
        held = np.where(
            np.abs(s) > 0, (z - 1) / np.where(s == 0, 1, s), self.dt
        )  # ∫ exp(s t) dt over a sample
        den = np.poly(s)
        values = den.real[1:].tolist()
        at = n
        for degree in self.degrees:
            if degree is None:
                continue
            first = 0 if degree == n else 1
            b = np.concatenate([np.zeros(first), x[at : at + n + 1 - first]])
            at += n + 1 - first
            # B/F = b_0 + Σ r/(z − z_i); each mode keeps its gain at rest when it is no longer held.
            rest = (b - b[0] * np.concatenate([[1.0], x[:n]]))[1:]
            num = (b[0] * den).astype(np.complex128)
            for i in range(n):
                others = np.delete(z, i)
                residue = np.polyval(rest, z[i]) / np.prod(z[i] - others)
                num[1:] += residue / held[i] * np.poly(np.delete(s, i))
            values += num.real[n - degree :].tolist()
        if not np.all(np.isfinite(values)):
            raise FitError(f"{what}: the converted model is not finite; lower poles=")
        return dict(zip(self.names, values, strict=True))


def stable(f: F64) -> F64:
    """f1 … fn with the roots of F inside the unit circle."""
    reduced = [1.0, *f.tolist()]
    while len(reduced) > 1:  # Schur and Cohn: much cheaper than the roots, and nearly always enough
        last = reduced[-1]
        if not abs(last) < 1:
            break
        reduced = [
            (a - last * b) / (1 - last * last) for a, b in zip(reduced, reversed(reduced), strict=True)
        ]
        reduced.pop()
    else:
        return f
    roots = np.roots(np.concatenate([[1.0], f]))
    size = np.abs(roots)
    if np.all(size < 1):
        return f
    inside = np.where(size >= 1, roots / np.maximum(size, 1e-300) ** 2, roots)
    return np.real(np.poly(np.where(np.abs(inside) > 0.999, 0.999 * inside, inside)))[1:]


def _shifted(v: F64, by: int) -> F64:
    """v delayed by some samples, zero before."""
    if by == 0:
        return v
    out = np.zeros_like(v)
    out[by:] = v[:-by]
    return out
