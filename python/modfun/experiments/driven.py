"""Responses of linear systems to white noise that drives them, exact at the samples."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .._core import normals
from ..base.arguments import reals
from ..base.arrays import F64
from ..errors import SpecError
from ..models.process import ProcessNoise
from ..systems.lti import LTI, state_space
from ..systems.making import tf

__all__ = ["Driven", "NoiseModel", "driven", "measured", "noise_model"]


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """x' = A x + G w, y = C x, where w is white noise of unit density.

    Attributes
    ----------
    a, c, enters : ndarray
        A (state, state), C (output, state) and G (state, noise).
    own : int
        States of the system; those of filters follow.
    """

    a: F64
    c: F64
    enters: F64
    own: int

    def over(self, dt: float) -> tuple[F64, F64]:
        """How a sample of the state follows from the one before: transition, and covariance of its noise.

        C. F. Van Loan, IEEE Trans. Automatic Control 23, 1978.
        """
        from scipy.linalg import expm

        n = len(self.a)
        density = self.enters @ self.enters.T
        whole = expm(np.block([[-self.a, density], [np.zeros((n, n)), self.a.T]]) * dt)
        step = whole[n:, n:].T
        cov = step @ whole[:n, n:]
        return step, (cov + cov.T) / 2

    def start(self, known: int = 0) -> F64:
        """Covariance of the state that noise has driven for long, its first entries being known."""
        from scipy.linalg import solve_continuous_lyapunov

        cov, a, enters = np.zeros_like(self.a), self.a[known:, known:], self.enters[known:]
        if np.all(np.linalg.eigvals(a).real < 0):  # else it begins at zero
            cov[known:, known:] = solve_continuous_lyapunov(a, -enters @ enters.T)
        return cov


def noise_model(system: Any, given: Any, who: str = "simulate") -> NoiseModel:
    """How noise of levels `given`, which `simulate` describes, moves the outputs of a linear system."""
    if isinstance(given, ProcessNoise):
        if given.estimated:
            raise SpecError(
                f"{who}: process_noise: the numerator of {given.estimated[0]} has no numbers; give a "
                "filter, as in mf.ProcessNoise(w=mf.tf([0.5, 1], [2, 1]))"
            )
        return NoiseModel(*_through_inputs(system, given, who), len(system.A))
    levels = np.atleast_1d(reals(who, "process_noise", given))
    a, c, enters = _by_equation(system, who)
    if levels.ndim != 1 or levels.size not in (1, enters.shape[1]) or not np.all(levels >= 0):
        raise SpecError(
            f"{who}: process_noise={given!r} must be a level of at least 0, one for all or one for each "
            f"of the {enters.shape[1]} equations of the system"
        )
    return NoiseModel(a, c, enters * levels, len(a))


@dataclass(frozen=True, eq=False)
class Driven:
    """Responses of a linear system to noise, stationary where the system is stable, else from zero.

    Attributes
    ----------
    first : ndarray, shape (state, state)
        Root of the covariance of the state at t = 0.
    held : ndarray, shape (state, state)
        Of unit noise of a step the input that, held over it, leaves the state where the noise would.
    system : LTI
        Of these inputs.
    dt : float
        Sampling interval, s.
    intervals : int
    """

    first: F64
    held: F64
    system: LTI
    dt: float
    intervals: int

    def response(self, seed: int, replicate: int, group: int = 0) -> F64:
        """Outputs (output, time) of an address of random numbers."""
        (outputs, _), n = self.system.shape, len(self.held)
        count = self.intervals + 2
        # The address of an output that is not there, beside those of the noise of the samples.
        draws = normals(seed, "noise_y", outputs, replicate, group, n * count).reshape(n, count)
        held = list(self.held @ draws[:, 1:])
        return self.system.respond(held, self.dt, self.intervals, self.first @ draws[:, 0], "zoh")


def driven(system: Any, given: Any, dt: float, intervals: int, who: str = "simulate") -> Driven:
    """What responses to noise of levels `given`, which `simulate` describes, are made of."""
    from scipy.linalg import expm

    model = noise_model(system, given, who)
    a, (n, outputs) = model.a, (len(model.a), len(model.c))
    over = expm(np.block([[a, np.eye(n)], [np.zeros((n, 2 * n))]]) * dt)[:n, n:]
    return Driven(
        first=_root(model.start()),
        held=np.linalg.solve(over, _root(model.over(dt)[1])),
        system=state_space(a, np.eye(n), model.c, np.zeros((outputs, n)), (0.0,) * n),
        dt=dt,
        intervals=intervals,
    )


def measured(system: Any, given: Any, who: str = "simulate") -> Any:
    """The system without the inputs through which noise enters."""
    if not isinstance(given, ProcessNoise):
        return system
    keep = [k for k, name in enumerate(_names(system, given, who)) if name not in given.names]
    delays = tuple([system.path_delays[0, k] for k in keep])
    known = state_space(system.A, system.B[:, keep], system.C, system.D[:, keep], delays)
    return replace(known, inputs=tuple([system.inputs[k] for k in keep]), outputs=system.outputs)


def _names(system: Any, given: ProcessNoise, who: str) -> tuple[str, ...]:
    if not isinstance(system, LTI) or system.inputs is None:
        raise SpecError(
            f"{who}: process_noise=ProcessNoise(...) names inputs of a linear system that has names, as "
            "StateSpace(...).model(values)"
        )
    missing = [name for name in given.names if name not in system.inputs]
    if missing:
        raise SpecError(
            f"{who}: process_noise: {missing[0]!r} is not an input of the system; it has "
            f"{list(system.inputs)}"
        )
    if np.any(system.path_delays != system.path_delays[0]):
        raise SpecError(f"{who}: process_noise=ProcessNoise(...) takes one delay an input, not a path")
    return system.inputs


def _through_inputs(system: Any, given: ProcessNoise, who: str) -> tuple[F64, F64, F64]:
    """The system behind the filters of its noise: A, C, and where white noise of unit density enters."""
    names = _names(system, given, who)
    a, c = system.A, system.C
    columns: list[F64] = []
    for name, (num, den) in given.filters:
        at = names.index(name)
        direct, shape = system.D[:, at : at + 1], tf(num, den).to_ss()
        if np.any(direct @ shape.D != 0):
            raise SpecError(
                f"{who}: process_noise: {name} is white and acts on an output directly, so its variance "
                "is infinite; give a filter with fewer zeros than poles, such as mf.dryden(tau)"
            )
        own, n, extra = system.B[:, at : at + 1], len(a), len(shape.A)
        # Columns of noise that came before end at the states there were.
        columns = [np.concatenate([column, np.zeros(extra)]) for column in columns]
        into = np.zeros((n, 1))
        into[: len(own)] = own
        a = np.block([[a, into @ shape.C], [np.zeros((extra, n)), shape.A]])
        c = np.hstack([c, direct @ shape.C])
        columns.append(np.concatenate([(into @ shape.D)[:, 0], shape.B[:, 0]]))
    return a, c, np.array(columns).T


def _root(cov: F64) -> F64:
    """A square root of a covariance, which may be singular."""
    values, vectors = np.linalg.eigh((cov + cov.T) / 2)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _by_equation(system: Any, who: str) -> tuple[F64, F64, F64]:
    """A, C, and where the noise of each equation enters: A(p) y = B(p) u + w, or x' = A x + B u + w."""
    if not isinstance(system, LTI):
        raise SpecError(
            f"{who}: process_noise= is for linear systems, mf.tf and mf.ss; of others add noise to an input"
        )
    if system.matrices is not None:
        return system.A, system.C, np.eye(len(system.A))
    orders, blocks = [], []
    for k, row in enumerate(system.polynomials()[1]):
        if any(not np.array_equal(row[0], own) for own in row[1:]):
            raise SpecError(
                f"{who}: process_noise= drives A(p) y = B(p) u + w; the paths to output {k} have "
                "denominators of their own. Give the system with one denominator an output, or as mf.ss"
            )
        den = np.asarray(row[0], dtype=np.float64)
        blocks.append(den[1:] / den[0])
        orders.append(den.size - 1)
    n = sum(orders)
    a, c, enters = np.zeros((n, n)), np.zeros((len(orders), n)), np.zeros((n, len(orders)))
    first = 0
    for k, (order, own) in enumerate(zip(orders, blocks, strict=True)):
        place = np.arange(first, first + order)
        a[place[:-1], place[1:]] = 1.0
        a[place[-1], place] = -own[::-1]
        c[k, first], enters[place[-1], k] = 1.0, 1.0
        first += order
    return a, c, enters
