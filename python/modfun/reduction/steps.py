"""The ways from a system to a model of lower order: state space of an order, structure, lines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..base.arrays import C128, F64
from ..base.samples import numbered
from ..errors import SpecError
from ..models.layout import Layout
from ..models.transfer_function import TransferFunction, system_of
from ..systems.lti import LTI
from ..systems.making import ss, tf
from .criterion import Criterion, Target, Weight, criterion_of, lines_criterion
from .fractions import Fractions, Region
from .gramians import Realisation
from .modes import fit_modes
from .norms import Response, h2_norm, hinf_norm, largest_gain
from .rational import RationalFit, fit_rational
from .reducible import FullOrder, Lines, realisation

__all__ = ["Found", "of_lines", "to_order", "to_structure"]

Contender = tuple[str, Response, Realisation | None]
Modal = tuple[Realisation, C128]  # and its gains on the lines

LOOK = 1e-3  # relative fall of the cost at which a start for others is good enough
NEAR = 0.1  # of their size: poles on the way to the same model
ON_THE_WAY = 1e-4  # the same of fits between two reweightings
PATIENCE = 20  # reweightings that lower the largest error by less than .1 % before the search ends


@dataclass(frozen=True, eq=False)
class Found:
    """A model, what it was held against, and what else is: name, response, states."""

    model: LTI
    target: Target
    criterion: Criterion
    contenders: list[Contender]
    kept_states: int
    nit: int
    status: str
    notes: list[str]


# To a state space of some order -------------------------------------------------------------------


def to_order(full: FullOrder, structure: Any, weight: Weight, band: Any, method: str, dcgain: bool) -> Found:
    """Balanced truncation, and modes fitted from there."""
    order = _poles(structure, full)
    count = order - full.kept.order
    if order >= full.order or count < 0:
        kept = f", {full.kept.order} of them not stable and kept" if full.kept.order else ""
        raise SpecError(
            f"reduce: {order} poles for a system of {full.order} states{kept}; give fewer than it has and "
            "not fewer than are kept"
        )
    target = Target(full.stable.response, full.range, full.stable)
    criterion = criterion_of(target, weight, band)
    truncated = full.balanced.truncated(count)
    found, nit = _settled(full, count) if dcgain else truncated, 0
    notes = _kept_notes(full)
    if count >= full.stable.order:
        notes.append(
            f"Inputs reach and outputs show only {full.stable.order} states of the stable part; nothing "
            "was left out."
        )
    elif method == "awls" and count:
        found, nit = _fitted_modes(full, found, criterion, dcgain)
    whole = found.plus(full.kept)
    model = ss(whole.a, whole.b, whole.c, whole.d, delay=full.delays)
    if isinstance(structure, TransferFunction):
        model = tf(*model.polynomials(), delay=full.delays)
    contenders: list[Contender] = [("this", found.response, found), _truncation(truncated)]
    return Found(model, target, criterion, contenders, count, nit, "ok", notes)


def _truncation(own: Realisation) -> Contender:
    return "balanced truncation", own.response, own


def _kept_notes(full: FullOrder) -> list[str]:
    if not full.kept.order:
        return []
    poles = ", ".join(f"{p:.4g}" for p in full.kept.poles)
    return [f"Poles that are not stable are kept with their residues: {poles} rad/s."]


def _poles(structure: Any, full: FullOrder) -> int:
    if not isinstance(structure, TransferFunction):
        return int(structure)
    plain = structure.poles - 1 == structure.zeros and not structure.params  # type: ignore[operator]
    if full.stable.d.size > 1 or not plain:
        raise SpecError(
            f"reduce: balanced truncation cannot make {structure}; give the number of poles, or use "
            "method='awls'"
        )
    return int(structure.poles)  # type: ignore[arg-type]


def _settled(full: FullOrder, count: int) -> Realisation:
    """Balanced truncation with the states left out taken as settled, which keeps the dc gain."""
    whole = full.stable
    if count >= whole.order:
        return whole
    k, rest = slice(0, count), slice(count, None)
    gain = np.linalg.solve(whole.a[rest, rest], np.hstack([whole.a[rest, k], whole.b[rest]]))
    return Realisation(
        whole.a[k, k] - whole.a[k, rest] @ gain[:, :count],
        whole.b[k] - whole.a[k, rest] @ gain[:, count:],
        whole.c[:, k] - whole.c[:, rest] @ gain[:, :count],
        whole.d - whole.c[:, rest] @ gain[:, count:],
    )


def _fitted_modes(
    full: FullOrder, start: Realisation, criterion: Criterion, dcgain: bool
) -> tuple[Realisation, int]:
    """Modes of the least criterion from balanced truncation on; never worse than that on the lines."""
    whole, lines = full.stable, criterion.grid
    dc = whole.response(np.zeros(1))[0].real - whole.d if dcgain else None
    region = _region(whole, criterion.minimax)

    def fit(weight: F64, begin: Modal, most: int = 200, tol: float = 1e-10) -> tuple[Modal, int]:
        found, gains, nit = fit_modes(
            lines.omega,
            lines.response - whole.d,
            np.sqrt(weight),
            begin[0],
            region,
            dcgain=dc,
            tol=tol,
            maxiter=most,
        )
        return (Realisation(found.a, found.b, found.c, whole.d), gains + whole.d), nit

    def begun(one: Realisation) -> Modal:
        return one, one.response(lines.omega)

    found, nit = fit(criterion.weight, begun(start))
    candidates = [found] if dcgain else [found, begun(full.balanced.truncated(start.order))]
    if whole.d.size == 1:  # of one path the poles say all, and other starts for them cost little
        layout = _layout(TransferFunction(poles=start.order), 1, 1)
        rational = fit_rational(
            lines.omega,
            (lines.response - whole.d).transpose(1, 2, 0),
            layout,
            criterion.weight,
            unstable=0,
            region=region,
            dcgain=dc,
            tol=LOOK,
            maxiter=200,
        )
        left = lines.response - found[1]
        lower = rational.cost < float(criterion.weight @ np.abs(left[:, 0, 0]) ** 2)
        # Where it comes near to what stands already, the way ends there.
        if lower or not _near(rational.poles[0], found[0].poles):
            fractions = Fractions(rational.poles[0]).state
            begin = Realisation(fractions[0], fractions[1][:, None], start.c, whole.d)
            other, more = fit(criterion.weight, begun(begin))
            candidates.append(other)
            nit += more
    if criterion.minimax:

        def largest(one: Modal) -> float:
            own, gains = one
            left, light = lines.response - gains, np.abs(own.poles.imag)
            return hinf_norm(lambda w: whole.response(w) - own.response(w), lines.omega, left, light)[0]

        def error(one: Modal) -> F64:
            return largest_gain(lines.response - one[1])

        found, more = _least_largest(fit, error, criterion, candidates)
        return min([found, *candidates], key=largest)[0], nit + more
    if criterion.kind == "h2" and criterion.whole:
        return min(candidates, key=lambda one: h2_norm(whole.minus(one[0])))[0], nit
    return min(candidates, key=lambda one: criterion.cost(one[1]))[0], nit


def _near(poles: C128, others: C128) -> bool:
    """Whether each pole has one of the others within a fraction of its size, and the other way round."""
    apart = np.abs(poles[:, None] - others)
    close = apart <= NEAR * np.minimum(np.abs(poles)[:, None], np.abs(others))
    return bool(np.all(close.any(axis=0)) and np.all(close.any(axis=1)))


def _region(whole: Realisation, minimax: bool) -> Region:
    """Around the poles of a system: a hundredth of its least damping; of minimax nothing faster."""
    size = np.abs(whole.poles)
    decay = -whole.poles.real
    fastest = float(np.max(size)) if minimax else float("inf")
    return Region(0.01 * float(np.min(decay)), 0.01 * float(np.min(decay / size)), fastest)


def _least_largest(
    fit: Callable[[F64, Any, int, float], tuple[Any, int]],
    errors: Callable[[Any], F64],
    criterion: Criterion,
    candidates: list[Any],
) -> tuple[Any, int]:
    """Lawson's reweighting: each line's weight times its error, again and again; the best on all ways."""
    total = 0
    found, least = None, float("inf")
    for here in candidates:
        weight, error = criterion.weight, errors(here)
        best, stalled = float("inf"), 0
        while stalled < PATIENCE:
            most = float(np.max(error))
            if most < least:
                found, least = here, most
            stalled = 0 if most < 0.999 * best else stalled + 1
            best = min(best, most)
            weight = weight * error
            weight = weight / np.sum(weight)
            here, nit = fit(weight, here, 10, ON_THE_WAY)
            total += nit
            error = errors(here)
    return found, total


# To transfer functions ----------------------------------------------------------------------------


def to_structure(
    full: FullOrder, structure: TransferFunction, weight: Weight, band: Any, dcgain: bool
) -> Found:
    """A rational fit of the structure, begun at the poles of balanced truncation and elsewhere."""
    outputs, inputs = full.stable.d.shape
    layout = _layout(structure, outputs, inputs)
    notes: list[str] = []
    if _same_delays(layout, full):
        layout = replace(layout, paths=tuple(replace(path, delay=0.0) for path in layout.paths))
        bare = _without(layout, full.kept.order)
        if bare is not None:
            target = Target(full.stable.response, full.range, full.stable)
            criterion = criterion_of(target, weight, band)
            bare = _with_feedthrough(bare, full.stable.d, criterion)
            fit = _fitted(bare, target, criterion, full, dcgain, 0)
            own = system_of(bare, fit.theta)
            model = _together(own, full)
            contenders: list[Contender] = [("this", _gains(own), realisation(own))]
            if bare.common:
                contenders.append(_truncation(full.balanced.truncated(bare.orders[0])))
            count = bare.orders[0] if bare.common else full.balanced.hankel.size
            notes = _kept_notes(full) + _status_notes(fit)
            return Found(model, target, criterion, contenders, count, fit.nit, _status(fit), notes)
        late = full.delays
    else:
        late = (0.0,) * inputs
        notes.append(
            "The model has other delays than the system; its poles take their place as far as they can."
        )
    if full.kept.order and band is None:
        raise SpecError(
            f"reduce: {full.kept.order} pole(s) of the system are not stable, and {structure} cannot hold "
            "them with their residues; take zeros=poles-1 with the system's delays and without params=, or "
            "name a band= to fit in"
        )

    def response(omega: F64) -> C128:
        found: C128 = full.response(omega) * np.exp(1j * omega[:, None, None] * np.array(late))
        return found

    target = Target(response, full.range, None)
    criterion = criterion_of(target, weight, band)
    fit = _fitted(layout, target, criterion, full, dcgain, full.kept.order)
    own = system_of(layout, fit.theta)
    model = tf(own.numerators, own.denominators, delay=late) if any(late) else own
    notes += _status_notes(fit)
    return Found(model, target, criterion, [("this", _gains(own), None)], 0, fit.nit, _status(fit), notes)


def of_lines(lines: Lines, structure: Any, weight: Weight, band: Any, dcgain: bool) -> Found:
    """A rational fit to the lines of a frequency response."""
    _, outputs, inputs = lines.data.shape
    if not isinstance(structure, TransferFunction):
        structure = TransferFunction(poles=int(structure), denominator="common" if outputs > 1 else None)
    layout = _layout(structure, outputs, inputs)
    criterion = lines_criterion(lines.omega, lines.data, weight, band)
    target = Target(lambda omega: criterion.grid.response, (lines.omega[0], lines.omega[-1]), None)
    if dcgain and lines.omega[0] != 0:
        raise SpecError("reduce: dcgain=True needs a line at 0 rad/s to know the gain there")
    dc = lines.data[0].real if dcgain else None
    fit = _rational(layout, criterion, None, 0, dc)
    own = system_of(layout, fit.theta)
    return Found(
        own, target, criterion, [("this", _gains(own), None)], 0, fit.nit, _status(fit), _status_notes(fit)
    )


def _layout(structure: TransferFunction, outputs: int, inputs: int) -> Layout:
    return structure.layout(numbered("y", outputs), numbered("u", inputs))


def _same_delays(layout: Layout, full: FullOrder) -> bool:
    return all(path.delay == full.delays[path.input] for path in layout.paths)


def _without(layout: Layout, kept: int) -> Layout | None:
    """The structure with fewer poles and zeros, or None where it cannot take all the residues of those."""
    if not kept:
        return layout
    free = all(v is None for v in layout.fixed) and all(b == (-np.inf, np.inf) for b in layout.bounds)
    n = layout.orders[0]
    degrees = [d for row in layout.numerators for d in row]
    if not (layout.common and free and n > kept and all(d is not None and d >= n - 1 for d in degrees)):
        return None
    zeros = [[d - kept for d in row if d is not None] for row in layout.numerators]
    smaller = TransferFunction(poles=n - kept, zeros=zeros, denominator="common")
    return _layout(smaller, len(layout.outputs), len(layout.inputs))


def _with_feedthrough(layout: Layout, d: F64, criterion: Criterion) -> Layout:
    """Leading coefficients held at the system's D, without which the difference has no H2 norm."""
    if not criterion.whole or criterion.minimax:
        return layout
    fixed = list(layout.fixed)
    for i, row in enumerate(layout.numerators):
        for j, degree in enumerate(row):
            at = layout.places[1][i][j]
            if degree == layout.orders[i] and fixed[at] is None:
                fixed[at] = float(d[i, j])
            elif degree != layout.orders[i] and d[i, j] != 0:
                raise SpecError(
                    "reduce: the system has a feedthrough that the structure leaves out, and the difference "
                    "would have no finite norm; take zeros=poles, or a band="
                )
    return replace(layout, fixed=tuple(fixed))


def _fitted(
    layout: Layout, target: Target, criterion: Criterion, full: FullOrder, dcgain: bool, unstable: int
) -> RationalFit:
    start = None
    held = any(value is not None for value in layout.fixed[: layout.orders[0]])
    count = layout.orders[0] - unstable
    if layout.common and not held and 0 < count <= full.stable.order:
        start = np.concatenate([full.balanced.truncated(count).poles, full.kept.poles[:unstable]])
    dc = target.response(np.zeros(1))[0].real if dcgain else None
    region = _region(full.stable, criterion.minimax) if not unstable and full.stable.order else None
    return _rational(layout, criterion, start, unstable, dc, region)


def _rational(
    layout: Layout,
    criterion: Criterion,
    start: C128 | None,
    unstable: int,
    dc: F64 | None,
    region: Region | None = None,
) -> RationalFit:
    """The better of the fits from a start and from poles spread over the band; reweighted for minimax."""
    lines = criterion.grid
    data = lines.response.transpose(1, 2, 0)

    def fit(weight: F64, begin: Any, most: int = 200, tol: float = 1e-12) -> tuple[RationalFit, int]:
        poles = None if begin is None else begin if isinstance(begin, list) else begin.free_poles
        given = weight if weight.ndim == 1 else weight.transpose(1, 2, 0)
        found = fit_rational(
            lines.omega,
            data,
            layout,
            given,
            unstable=unstable,
            region=region,
            dcgain=dc,
            start=poles,
            tol=tol,
            maxiter=most,
        )
        return found, found.nit

    begins = [None] if start is None else [None, [start]]
    candidates = [fit(criterion.weight, begin)[0] for begin in begins]
    if criterion.minimax:

        def error(one: RationalFit) -> F64:
            return largest_gain(lines.response - one.response.transpose(2, 0, 1))

        best: RationalFit = _least_largest(fit, error, criterion, candidates)[0]
        return best
    return min(candidates, key=lambda one: one.cost)


def _gains(own: LTI) -> Response:
    return lambda omega: own.frequency_response(omega).response.transpose(2, 0, 1)


def _together(own: LTI, full: FullOrder) -> LTI:
    """The fitted part and the kept poles over one denominator, with the delays."""
    num, den = own.polynomials()
    if full.kept.order:
        kept = full.kept
        other, slow = ss(kept.a, kept.b, kept.c).polynomials()
        common, more = den[0][0], slow[0][0]
        num = tuple(
            tuple(
                np.asarray(np.polyadd(np.polymul(n, more), np.polymul(m, common)), dtype=np.float64)
                for n, m in zip(*rows, strict=True)
            )
            for rows in zip(num, other, strict=True)
        )
        whole = np.asarray(np.polymul(common, more), dtype=np.float64)
        den = tuple((whole,) * len(row) for row in den)
    return tf(num, den, delay=full.delays)


def _status(fit: RationalFit) -> str:
    return "ok" if fit.status == "rank" else fit.status  # poles that zeros cancel are among the notes


def _status_notes(fit: RationalFit) -> list[str]:
    if fit.status == "rank":
        return ["The model has poles that its zeros cancel: fewer would do."]
    return []
