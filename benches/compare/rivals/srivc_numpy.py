"""SRIVC in NumPy: simplified refined instrumental variables for continuous time, white output noise.

With unknown initial conditions the free responses of 1/A are further regressors, their own instruments.
At convergence the residual is the output error y - (B u + T)/A, exact between the samples for a held or
linear input: how the filtered output is interpolated does not matter there.
"""

import numpy as np
from scipy.signal import butter, lfilter


class Filters:
    """v, p v, …, pⁿ⁻¹ v through 1/A(p), exact for held or linear v."""

    def __init__(self, a, dt):
        n = len(a)
        companion = np.eye(n, k=1)
        companion[-1] = -np.asarray(a)[::-1]
        s, vectors = np.linalg.eig(companion)
        if np.linalg.cond(vectors / np.abs(vectors).max(axis=0)) > 1e12:
            raise ArithmeticError("SRIVC: poles of the filter coincide")
        inverse = np.linalg.inv(vectors)
        twice = np.where(s.imag > 0, 2.0, 1.0)  # a conjugate pair is worked out once
        kept = s.imag >= 0
        self.s, self.z = s[kept], np.exp(s[kept] * dt)
        self.dt = dt
        self.out = (vectors * twice)[:, kept]
        self.inverse = inverse[kept]
        held = np.where(self.s == 0, dt, (self.z - 1) / np.where(self.s == 0, 1, self.s))
        self.held = held
        self.later = (held - dt) / (self.s * dt)

    def __call__(self, v, hold):
        """(n, samples), from rest."""
        modes = np.empty((self.s.size, v.size), dtype=complex)
        for i, z in enumerate(self.z):
            gain = self.inverse[i, -1]
            later = 0.0 if hold == "zoh" else self.later[i]
            b = gain * np.array([later, self.held[i] - later])
            modes[i] = lfilter(b, [1.0, -z], v, zi=np.array([-b[0] * v[0]]))[0]
        return (self.out @ modes).real

    def free(self, samples):
        """Free responses of 1/A to each unit state, (n, samples)."""
        modes = np.exp(np.outer(self.s, self.dt * np.arange(samples)))
        return np.array([((self.out[0] * unit) @ modes).real for unit in self.inverse.T])


def stable(a):
    """Poles in the right half plane mirrored."""
    roots = np.roots(np.concatenate([[1.0], a]))
    return a if np.all(roots.real < 0) else np.poly(-np.abs(roots.real) + 1j * roots.imag).real[1:]


class Srivc:
    """Call it with a record for θ; raises ArithmeticError where it does not converge."""

    def __init__(self, problem, initial=True, tolerance=1e-7, most=50):
        self.problem, self.initial, self.tolerance, self.most = problem, initial, tolerance, most
        self.hold = "zoh" if problem.hold == "zoh" else "foh"
        # The first filter: a state variable filter with the poles of Butterworth's.
        self.first = butter(problem.poles, problem.cutoff, analog=True)[1][1:]

    def _step(self, a, coefficients, u, y):
        """θ and end conditions from filters 1/A; instruments from the last model, or the regressors."""
        m = self.problem.zeros
        filters = Filters(a, self.problem.dt)
        driven = filters(u, self.hold)[m::-1]
        extra = filters.free(u.size) if self.initial else np.empty((0, u.size))
        known = np.vstack([driven, extra])
        past = filters(y, "foh")[::-1]
        columns = np.vstack([-past, known]).T
        target = y - past.T @ np.asarray(a)
        if coefficients is None:
            instruments = columns
        else:
            instruments = np.vstack([-filters(coefficients @ known, "foh")[::-1], known]).T
        size = np.linalg.norm(instruments, axis=0)
        left = instruments / size
        return np.linalg.solve(left.T @ (columns / size), left.T @ target) / size

    def __call__(self, rec, rng=None):
        """θ of a record."""
        n, count = self.problem.poles, len(self.problem.truth)
        u, y = rec.u[0], rec.y[0]
        theta = self._step(self.first, None, u, y)
        for _ in range(self.most):
            a = stable(theta[:n])
            before, theta = theta, self._step(a, self._refitted(a, u, y), u, y)
            if not np.all(np.isfinite(theta)):
                break
            if np.max(np.abs(theta[:count] / before[:count] - 1)) < self.tolerance:
                return theta[:count]
        raise ArithmeticError("SRIVC: not converged")

    def _refitted(self, a, u, y):
        """Numerator and free response at their best for a denominator."""
        filters = Filters(a, self.problem.dt)
        known = filters(u, self.hold)[self.problem.zeros :: -1]
        if self.initial:
            known = np.vstack([known, filters.free(u.size)])
        size = np.linalg.norm(known, axis=1)
        left = known / size[:, None]
        return np.linalg.solve(left @ left.T, left @ y) / size
