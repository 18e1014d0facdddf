"""Known systems in series with the plant: sensors and actuators, taken over to the inputs."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil
from typing import Any

import numpy as np

from ..base.arguments import public, real
from ..base.names import nearest
from ..errors import DataError, SpecError
from ..records.record import Record
from ..systems.lti import LTI
from ..systems.making import linear, tf

__all__ = ["through"]

FORGOTTEN = 9.0  # time constants of the slowest pole, after which 1e-4 is left of a state
QUIET = 4  # samples with steady inputs, before which the filters are taken as steady


@public
def through(
    rec: Record,
    *,
    actuator: Any = None,
    sensor: Any = None,
    settle: float | None = None,
) -> Record:
    """The record in which known actuators and a known sensor are part of the inputs.

    The plant G sees K u behind the actuator K, and the sensor H shows H G K u. Systems in series change
    places: H G K u = G (H K u), so that G is fitted between the inputs H K u and the outputs as they were
    measured, whose noise stays white. H K u is exact at the samples, whatever the inputs do between them.

    Parameters
    ----------
    rec : Record
        Evenly sampled.
    actuator : LTI, or mapping of str to LTI, optional
        Stable systems of one input and output: one for all inputs, or by input.
    sensor : LTI, optional
        Stable; one for all outputs, since their inputs are the same.
    settle : float, optional
        Seconds that are cut off at the beginning, where the states of actuator and sensor are unknown.
        Default: nine of their longest time constants and their delay; none where the inputs stand at first,
        as before a step, where the filters are taken as steady.

    Returns
    -------
    Record
        The same outputs, and inputs H K u, smooth between samples.

    Raises
    ------
    SpecError
        Systems that are not stable or have several inputs or outputs, or names that the record does not have.
    DataError
        A record with uneven steps, or shorter than its filters take to settle.

    See Also
    --------
    modfun.fit : ``mf.fit(mf.through(rec, sensor=H), model)`` is the plant alone.

    References
    ----------
    The guide docs/known.md, "Sensors and actuators".

    Examples
    --------
    >>> import modfun as mf
    >>> servo = mf.tf([1], [0.2, 1])
    >>> both = mf.tf([5], [0.2, 1.6, 4.6, 8])  # 5/(s² + 3 s + 8) behind the servo
    >>> rec = mf.simulate(both, input="sin(t**2/5)", duration=12.0, intervals=512)
    >>> fit = mf.fit(mf.through(rec, actuator=servo), mf.TransferFunction(poles=2, zeros=0))
    >>> print(fit.params.round(3))
    [3. 8. 5.]
    """
    if rec.dt is None:
        raise DataError("through: the record's steps are uneven; resample it, so that inputs can be filtered")
    shown = None if sensor is None else _checked(sensor, "sensor")
    by_input = actuator if isinstance(actuator, Mapping) else dict.fromkeys(rec.inputs, actuator)
    for name in by_input:
        if name not in rec.inputs:
            raise SpecError(f"through: actuator= names {name!r}; {nearest(name, rec.inputs)}")
    u, kinds, longest = rec.u.copy(), list(rec.intersample), 0.0
    filtered_names: list[str] = []
    for k, name in enumerate(rec.inputs):
        own = by_input.get(name)
        steps = [] if own is None else [_checked(own, f"actuator of {name}")]
        filters = steps if shown is None else [*steps, shown]
        if not filters:
            continue
        whole = filters[0] if len(filters) == 1 else _product(*filters)
        first = u[k, 0]
        moved = whole.simulate(u=u[k] - first, dt=rec.dt, intersample=kinds[k])
        u[k] = moved + float(np.real(whole(0.0))) * first
        kinds[k] = "smooth"
        filtered_names.append(name)
        longest = max(longest, _memory(whole))
    if settle is None:
        moving = np.any(rec.u != rec.u[:, :1], axis=0)
        settle = 0.0 if int(np.argmax(moving)) >= QUIET else longest
    cut = ceil(real("through", "settle", settle) / rec.dt - 1e-9)
    if cut < 0 or cut > rec.intervals // 2:
        raise DataError(
            f"through: actuator and sensor take {settle:.4g} s to settle, of a record of {rec.duration:.4g} "
            "s; take a longer one, or settle=0 if they are steady at its first sample"
        )
    seen = {name: form for name, form in rec._seen.items() if name not in filtered_names}
    filtered = rec._like(u=u, intersample=tuple(kinds), _seen=seen)
    return filtered.window(rec.t[cut], rec.t[-1]) if cut else filtered


def _checked(given: Any, what: str) -> LTI:
    system = linear(given, "through")
    if not isinstance(system, LTI) or system.shape != (1, 1):
        raise SpecError(
            f"through: the {what} must be a system of one input and one output, as mf.tf([1], [0.1, 1])"
        )
    poles = system.poles()
    if poles.size and not np.max(poles.real) < 0:
        raise SpecError(
            f"through: the {what} has the pole {poles[np.argmax(poles.real)]:.4g}; it must be stable, or its "
            "state at the first sample is never forgotten"
        )
    return system


def _product(a: LTI, b: LTI) -> LTI:
    late = float(np.max(a.path_delays) + np.max(b.path_delays))
    return tf(np.polymul(a.num, b.num), np.polymul(a.den, b.den), delay=late)


def _memory(system: LTI) -> float:
    """Seconds after which an initial state is forgotten."""
    poles = system.poles()
    slowest = float(np.max(poles.real)) if poles.size else -np.inf
    return FORGOTTEN / -slowest + float(np.max(system.path_delays))
