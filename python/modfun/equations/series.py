"""Known systems in series with the plant: taken over to the inputs of a record, or into a state space."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil
from typing import Any, overload

import numpy as np

from ..base.arguments import public, real
from ..base.names import nearest
from ..errors import DataError, SpecError
from ..records.record import Record
from ..records.steady import QUIET, standing
from ..systems.lti import LTI
from ..systems.making import linear, tf
from .matrices import Entry
from .state_space import StateSpace

__all__ = ["through"]

FORGOTTEN = 9.0  # time constants of the slowest pole, after which 1e-4 is left of a state


@overload
def through(
    rec: Record, *, actuator: Any = None, sensor: Any = None, settle: float | None = None
) -> Record: ...
@overload
def through(rec: StateSpace, *, sensor: Mapping[str, Any]) -> StateSpace: ...
@public
def through(
    rec: Any,
    *,
    actuator: Any = None,
    sensor: Any = None,
    settle: float | None = None,
) -> Any:
    """The record in which known actuators and a known sensor are part of the inputs.

    Of a `StateSpace`: the model with a sensor for each output that is named. The sensors' states become those
    of the model, with known coefficients, so that the parameters are the plant's alone, and the noise of the
    measured outputs stays white.

    The plant G sees K u behind the actuator K, and the sensor H shows H G K u. Systems in series change
    places: H G K u = G (H K u), so that G is fitted between the inputs H K u and the outputs as they were
    measured, whose noise stays white. H K u is exact at the samples, whatever the inputs do between them.

    Parameters
    ----------
    rec : Record or StateSpace
        A record is evenly sampled.
    actuator : LTI, or mapping of str to LTI, optional
        Stable systems of one input and output: one for all inputs, or by input.
    sensor : LTI, or mapping of str to LTI, optional
        Stable; of a record one for all outputs, since their inputs are the same; of a model a mapping of
        outputs to systems without delay. A plant's state that has the name of such an output is then called
        ``q_true``.
    settle : float, optional
        Seconds that are cut off at the beginning, where the states of actuator and sensor are unknown.
        Default: nine of their longest time constants and their delay; none where the inputs stand at first,
        as before a step, where the filters are taken as steady.

    Returns
    -------
    Record or StateSpace
        The same outputs, and inputs H K u, smooth between samples; or the model with its sensors.

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

    >>> motion = mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"])
    >>> mf.through(motion, sensor={"q": mf.tf([1], [0.15, 1])}).states
    ('alpha', 'q_true', 'q')
    """
    if isinstance(rec, StateSpace):
        return _seen_through(rec, actuator, sensor, settle)
    if rec.dt is None:
        raise DataError("through: the record's steps are uneven; resample it, so that inputs can be filtered")
    if isinstance(sensor, Mapping):
        raise SpecError(
            "through: inputs are the same for all outputs, so a record takes one sensor for all of them; for "
            "a sensor of each output give a StateSpace, mf.through(model, sensor={...}), or fit each output "
            "alone"
        )
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
        settle = 0.0 if standing(rec) >= QUIET else longest
    cut = ceil(real("through", "settle", settle) / rec.dt - 1e-9)
    if cut < 0 or cut > rec.intervals // 2:
        raise DataError(
            f"through: actuator and sensor take {settle:.4g} s to settle, of a record of {rec.duration:.4g} "
            "s; take a longer one, or settle=0 if they are steady at its first sample"
        )
    seen = {name: form for name, form in rec._seen.items() if name not in filtered_names}
    filtered = rec._like(u=u, intersample=tuple(kinds), _seen=seen)
    return filtered.window(rec.t[cut], rec.t[-1]) if cut else filtered


def _seen_through(model: StateSpace, actuator: Any, sensor: Any, settle: Any) -> StateSpace:
    """The model with a sensor for each output that is named."""
    if actuator is not None or settle is not None or not isinstance(sensor, Mapping) or not sensor:
        raise SpecError(
            "through: a StateSpace takes sensors by output, sensor={'q': mf.tf([1], [0.1, 1])}; actuators go "
            "through the record, mf.through(rec, actuator=...)"
        )
    for name in sensor:
        if name not in model.outputs:
            raise SpecError(f"through: sensor= names {name!r}; {nearest(name, model.outputs)}")
    systems = {name: _checked(own, f"sensor of {name}") for name, own in sensor.items()}
    if late := [name for name, own in systems.items() if np.any(own.path_delays)]:
        raise SpecError(
            f"through: the sensor of {late[0]} has a delay, which no state is; shift its samples instead"
        )
    states = [f"{name}_true" if name in systems else name for name in model.states]
    size = len(states) + sum(own.den.size - 1 for own in systems.values())
    a, b = ([list(row) for row in matrix] for matrix in (model.A, model.B))
    a = [[*row, *[0.0] * (size - len(row))] for row in a]
    c = [[*row, *[0.0] * (size - len(row))] for row in model.C]
    d = [list(row) for row in model.D]
    for i, name in enumerate(model.outputs):
        if name not in systems:
            continue
        den, num = (own / systems[name].den[0] for own in (systems[name].den, systems[name].num))
        num = np.append(np.zeros(den.size - num.size), num)
        first, direct = len(a), float(num[0])
        # Its states: z_k' = z_(k+1) − a_k z_1 + b_k v with v from the plant; its output is z_1 + b_0 v.
        for k, (pole, zero) in enumerate(zip(den[1:], num[1:] - direct * den[1:], strict=True)):
            row = [_times(float(zero), entry) for entry in c[i]]
            row[first] = -float(pole)
            if k + 2 < den.size:
                row[first + k + 1] = 1.0
            a.append(row)
            b.append([_times(float(zero), entry) for entry in d[i]])
        c[i], d[i] = ([_times(direct, entry) for entry in row] for row in (c[i], d[i]))
        if den.size > 1:
            c[i][first] = 1.0
        states += [name if k == 0 and direct == 0 else f"{name}_{k + 1}" for k in range(den.size - 1)]
    return StateSpace(
        a, b if model.inputs else None, c, d if model.inputs else None,
        states=states, inputs=model.inputs, outputs=model.outputs, params=dict(model.params),
        delay=model.delay,
    )  # fmt: skip


def _times(factor: float, entry: Entry) -> Entry:
    """An entry of a matrix times a number."""
    if isinstance(entry, str) and factor not in (0.0, 1.0):
        return f"{factor!r}*({entry})"
    return entry if factor == 1.0 else 0.0 if factor == 0.0 else factor * float(entry)


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
