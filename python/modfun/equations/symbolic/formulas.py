"""Compiled equations as the core takes them: tapes of signals, slopes and coefficients, and channels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import combinations
from typing import Any, TypeVar

import numpy as np
import sympy

from ...base.arrays import F64
from ...base.cached import cached_property
from ...errors import SpecError
from ...models.free import Free
from .compiled import Compiled, Delayed, Term, jet, time
from .noise_bias import unbiased
from .sides import side, sided
from .smoothing import smoothed
from .tape import tape
from .times import Times, moved
from .words import said

__all__ = ["Formulas", "formulas", "of_record"]

_ANYTHING = Free()
Value = TypeVar("Value")
Kinds = tuple[str, ...]  # in all records, or in each


def of_record(values: tuple[Value, ...], record: int) -> Value:
    """That of a record, of one for all records or one for each."""
    return values[record if len(values) > 1 else 0]


@dataclass(frozen=True)
class Channel:
    """One row of what the core is given: an output, an input, or what is made of them.

    Attributes
    ----------
    symbol : Symbol
        Stands for it in the formulas.
    kind : str
        "output", "log" (of an output), "smooth" (a derivative of a smoothed expression), "gain" (of the noise
        in it), "input", "held" (its mean over both sides of a sample where it is held), "time", "known",
        "side" (the sign that an expression of the others has in a record).
    of : object
        Position of the channel, or (expression, derivative), or a known function.
    late : float
        Seconds by which it is late; negative: early.
    straight : tuple of bool
        Whether it is interpolated linearly where these are no whole samples: in all records, or in each.
    held : tuple of bool
        Of "held": in which records, in all or in each.
    """

    symbol: sympy.Symbol
    kind: str
    of: Any = None
    late: float = 0.0
    straight: tuple[bool, ...] = (False,)
    held: tuple[bool, ...] = ()

    @property
    def own(self) -> bool:
        """Whether it differs from record to record though the inputs do not."""
        return self.kind in ("output", "log", "smooth", "gain", "side")


@dataclass(frozen=True, eq=False)
class Formulas:
    """Tapes and channels of one set of equations.

    Attributes
    ----------
    compiled : Compiled
    words : dict
        Keywords of the core, those of `Options` aside.
    channels : tuple of Channel
    noisy : tuple of str
        Names of the noisy channels.
    expressions : tuple of list
        Signals and slopes, the symbols in them (channels, variances, covariances and parameters), and the
        coefficients of the terms.
    """

    compiled: Compiled
    words: dict[str, Any]
    channels: tuple[Channel, ...]
    noisy: tuple[str, ...]
    expressions: tuple[list[sympy.Expr], list[sympy.Symbol], list[sympy.Expr]]

    def rows(self, y: F64, u: F64, t: F64, own: bool | None = None, record: int = 0) -> F64:
        """Channels (channel, time) of a record; `own`: only those that differ among records of one input."""
        rows = [self._late_row(c, y, u, t, record) for c in self.channels if own is None or c.own == own]
        return np.ascontiguousarray(np.vstack(rows or [np.empty((0, t.size))]))

    def _late_row(self, channel: Channel, y: F64, u: F64, t: F64, record: int) -> Any:
        row = self._row(channel, y, u, t, record)
        if not channel.late:
            return row
        return moved(np.asarray(row), channel.late / float(t[1] - t[0]), of_record(channel.straight, record))

    def _row(self, channel: Channel, y: F64, u: F64, t: F64, record: int) -> Any:
        if channel.kind == "output":
            return y[channel.of]
        if channel.kind == "log":
            with np.errstate(divide="ignore", invalid="ignore"):
                return np.log(y[channel.of])
        if channel.kind in ("smooth", "gain"):
            expr, order, gain = channel.of
            values = self.values(expr, y, u, t)
            return smoothed(values, t, order, gain=gain)
        if channel.kind == "time":
            return t
        if channel.kind == "known":
            given = channel.of
            return np.asarray(given(t) if callable(given) else given, dtype=float)
        if channel.kind == "side":
            inside = [c for c in self.channels if c.symbol in channel.of.free_symbols]
            rows = {c.symbol: self._late_row(c, y, u, t, record) for c in inside}
            return np.full(t.size, side(channel.of, rows))
        row = u[channel.of]
        if channel.kind == "held" and of_record(channel.held, record):
            return np.concatenate([row[:1], (row[:-1] + row[1:]) / 2])
        return row

    def values(self, expr: sympy.Expr, y: F64, u: F64, t: F64) -> F64:
        """Samples of an expression of outputs, inputs and the time."""
        names = [*self.compiled.outputs, *self.compiled.inputs]
        symbols = [*(jet(name) for name in names), time]
        found = _function(tuple(symbols), expr)(*y, *u, t)
        return np.broadcast_to(np.asarray(found, dtype=float), t.shape)

    def without_value(self, y: F64, u: F64, t: F64) -> tuple[sympy.Expr, sympy.Expr, F64] | None:
        """A logarithm or root in the signals, its argument, and this over a record where it is negative."""
        results, symbols, _ = self.expressions
        given = symbols[: len(self.channels)]
        atoms = set().union(*(expr.atoms(sympy.log, sympy.Pow) for expr in results))
        for one in sorted(atoms, key=str):
            inner = one.args[0]
            whole = one.is_Pow and one.exp.is_integer is not False
            if whole or not inner.free_symbols or not inner.free_symbols <= set(given):
                continue
            rows = self.rows(y, u, t)
            sides = [k for k, c in enumerate(self.channels) if c.kind == "side"]
            one, inner = (e.xreplace({given[k]: int(rows[k, 0]) for k in sides}) for e in (one, inner))
            plain = [sympy.Dummy() for _ in given]
            found = sympy.lambdify(plain, inner.xreplace(dict(zip(given, plain, strict=True))), "numpy")
            values = np.broadcast_to(np.asarray(found(*rows), dtype=float), t.shape)
            if np.any(values <= 0 if one.func == sympy.log else values < 0):
                return one, inner, values
        return None

    @cached_property
    def needs_levels(self) -> bool:
        """Whether the sizes of the noise levels matter."""
        return bool(self.words["levels_matter"])


_function = lru_cache(maxsize=64)(partial(sympy.lambdify, modules="numpy"))


def formulas(
    compiled: Compiled,
    rule: str,
    forms: Sequence[Sequence[str]],
    noisy: Sequence[str],
    log: bool,
    correct: bool,
) -> Formulas:
    """Tapes of compiled equations.

    Parameters
    ----------
    compiled : Compiled
    rule : str
        Quadrature of smooth signals.
    forms : sequence of sequence of str
        How each input goes between samples: in all records, or in each.
    noisy : sequence of str
        Names of the channels with noise.
    log : bool
        Whether the noise multiplies the outputs, which then stand as exponentials of their logarithms.
    correct : bool
        Whether what noise adds to nonlinear signals is taken out.

    Raises
    ------
    SpecError
        A product of channels at different times that has no form here.
    """
    each = [dict(zip(compiled.inputs, words, strict=True)) for words in forms]
    writer = _Writer(compiled, rule, each, noisy, log, correct)
    for term in compiled.terms:
        writer.term(term)
    return writer.finished()


class _Writer:
    def __init__(
        self,
        compiled: Compiled,
        rule: str,
        forms: Sequence[dict[str, str]],
        noisy: Sequence[str],
        log: bool,
        correct: bool,
    ) -> None:
        self.compiled = compiled
        self.rule, self.forms, self.correct = rule, forms, correct
        self.noisy = tuple(noisy)
        self.parameters = [sympy.Symbol(name, real=True) for name in compiled.parameters]
        self.log = {jet(name): sympy.exp(_logarithm(name)) for name in compiled.outputs} if log else {}
        self.noise = {
            (_logarithm(name) if log and name in compiled.outputs else jet(name)): sympy.Symbol(
                f"variance of {name}", positive=True
            )
            for name in noisy
        }
        self.common = {
            both: sympy.Symbol(f"covariance of {both[0]} and {both[1]}", real=True)
            for both in combinations(self.noise, 2)
        }
        self.signals: list[tuple[sympy.Expr, Kinds, sympy.Expr]] = []
        self.held: dict[sympy.Symbol, tuple[str, tuple[bool, ...]]] = {}
        self.sensitive: list[dict[sympy.Symbol, sympy.Expr]] = []
        self.terms: list[tuple[int, int, int]] = []
        self.coefficients: list[sympy.Expr] = []
        self.smooth: dict[tuple[sympy.Expr, int, bool], sympy.Symbol] = {}
        self.times = Times([*self.parameters, *self.noise.values(), *self.common.values()])

    def term(self, term: Term) -> None:
        """Adds a term; one with a factor becomes terms of the smoothed factor's derivatives (Property 2)."""
        if term.factor is None:
            for at in self.signal(term.signal):
                self._append(term, term.order, at, term.coefficient)
            return
        if term.factor.has(Delayed) or term.signal.has(Delayed):
            raise SpecError(
                f"fitting an equation: {said(term.factor)} times a derivative of {said(term.signal)} mixes "
                "channels at different times and has no exact form; measure the derivative as a channel of "
                "its own, or add the shifted samples to the record as one"
            )
        if self.log:
            raise SpecError(
                f"fitting an equation: {term.factor} times a derivative of {term.signal} has no exact form, "
                'and is not taken with noise="log-normal"; use noise="output"'
            )
        k = term.order
        for i in range(k + 1):
            sign = sympy.Integer((-1) ** i) * sympy.binomial(k, i)
            # Noise on the factor acts through the signal's own k-th derivative, all of it in the last term.
            through = term.factor if i == k else None
            at = self.product(term.factor, i, term.signal, k, through, sign)
            self._append(term, k - i, at, sign * term.coefficient)

    def _append(self, term: Term, order: int, signal: int, coefficient: sympy.Expr) -> None:
        self.terms.append((term.equation, signal, order))
        self.coefficients.append(sympy.sympify(coefficient))

    def signal(self, expr: sympy.Expr) -> list[int]:
        """Positions of a signal, with what noise adds taken out, and of what is zero but for noise.

        A signal of channels at different times is sampled in time. Noise of another time has a signal of its
        own behind it, which is late by as much, as the noise is.
        """
        expr, late = self._undelayed(expr)
        kind, expr = self._kind(expr)
        others = sorted({d.args[1] for d in expr.atoms(Delayed)}, key=float)
        expr = expr.subs(self.log).replace(Delayed, self.times.later)
        at = {h: {c: self.times.later(c, h) for c in self.noise} for h in others}
        if self.correct:
            noise, common = dict(self.noise), dict(self.common)
            for own in at.values():
                noise |= {own[c]: variance for c, variance in self.noise.items()}
                common |= {(own[a], own[b]): covariance for (a, b), covariance in self.common.items()}
            expr = unbiased(expr, noise, common)
        found = [self._placed(expr, kind, late, _slopes(expr, {c: c for c in self.noise}))]
        for h, own in at.items():
            slopes = {c: self.times.later(d, -h) for c, d in _slopes(expr, own).items()}
            found.append(self._placed(sympy.Integer(0), ("trapezoid",), h, slopes))
        return found

    def _placed(
        self, expr: sympy.Expr, kind: Kinds, late: sympy.Expr, found: dict[sympy.Symbol, sympy.Expr]
    ) -> int:
        for at, known in enumerate(zip(self.signals, self.sensitive, strict=True)):
            if known == ((expr, kind, late), found):
                return at
        self.signals.append((expr, kind, late))
        self.sensitive.append(found)
        return len(self.signals) - 1

    def product(
        self,
        factor: sympy.Expr,
        derivative: int,
        signal: sympy.Expr,
        order: int,
        through: sympy.Expr | None,
        sign: sympy.Expr,
    ) -> int:
        """Position of F⁽ⁱ⁾E with F smoothed."""
        front = self._smoothed(factor, derivative)
        inner = unbiased(signal, self.noise, self.common) if self.correct else signal
        expr = front * inner
        found = {c: front * sympy.diff(inner, c) for c in self.noise}
        if self.correct:
            for (left, right), covariance in self._covariances():
                both = sympy.diff(factor, left) * sympy.diff(signal, right)
                if both != 0:
                    gain = self._smoothed(factor, derivative, gain=True)
                    expr -= covariance * gain * both
        if through is not None:
            own = self._smoothed(signal, order)
            for channel in self.noise:
                # The sign of the term is taken out again: it belongs to the product alone.
                found[channel] += sign * sympy.diff(through, channel) * own
        kind = self._kind(expr)[0]
        return self._placed(expr, kind, sympy.Integer(0), {c: d for c, d in found.items() if d != 0})

    def _covariances(self) -> Iterator[tuple[tuple[sympy.Symbol, sympy.Symbol], sympy.Symbol]]:
        """Each noisy channel beside each, and what their noise has in common."""
        for channel, variance in self.noise.items():
            yield (channel, channel), variance
        for (left, right), covariance in self.common.items():
            yield (left, right), covariance
            yield (right, left), covariance

    def _smoothed(self, expr: sympy.Expr, derivative: int, gain: bool = False) -> sympy.Symbol:
        if derivative == 0 and not gain and not (expr.free_symbols & set(self.noise)):
            return expr
        key = (expr, derivative, gain)
        if key not in self.smooth:
            self.smooth[key] = sympy.Symbol(f"smooth {len(self.smooth)}", real=True)
        return self.smooth[key]

    def _undelayed(self, expr: sympy.Expr) -> tuple[sympy.Expr, sympy.Expr]:
        """The expression at its own time, and how late all of it is; as it stands where that differs."""
        late = {d: sympy.Dummy() for d in expr.atoms(Delayed)}
        delays = {d.args[1] for d in late}
        if not delays:
            return expr, sympy.Integer(0)
        channels = {jet(name) for name in (*self.compiled.outputs, *self.compiled.inputs)}
        others = expr.xreplace(late).free_symbols & (channels | {time} | set(self.compiled.known))
        if len(delays) == 1 and not others:
            return expr.replace(Delayed, lambda channel, _: channel), delays.pop()
        free = sorted(str(h) for h in delays if h.free_symbols)
        if free:
            raise SpecError(
                f"fitting an equation: the signal {said(expr)} mixes channels at different times, and the "
                f"delay {free[0]} is a parameter; give it a number, params={{{free[0]!r}: 0.5}}, and compare "
                "the fits of some numbers (a logarithm often separates a product)"
            )
        return expr, sympy.Integer(0)

    def _kind(self, expr: sympy.Expr) -> tuple[Kinds, sympy.Expr]:
        """How the samples of a signal stand for it, in all records or each, and the signal as sampled."""
        if not expr.free_symbols - set(self.parameters):
            return ("trapezoid",), expr  # a constant: exact, and on line 0 alone
        names = [name for name in self.compiled.inputs if jet(name) in expr.free_symbols]
        kinds = tuple([self._kind_in(expr, [words[name] for name in names]) for words in self.forms])
        sampled = {}
        for name in names:
            # Between samples a held input stands still: each sample belongs half to both sides.
            each = zip(kinds, self.forms, strict=True)
            held = tuple([kind != "zoh" and words[name] == "zoh" for kind, words in each])
            if any(held):
                sampled[jet(name)] = _held(name, held)
                self.held[sampled[jet(name)]] = name, held
        return kinds if len({*kinds}) > 1 else kinds[:1], expr.subs(sampled)

    def _kind_in(self, expr: sympy.Expr, words: Sequence[str]) -> str:
        """How its samples stand for a signal of inputs that go so between theirs, and of what else it has."""
        inputs = {jet(name) for name in self.compiled.inputs} & expr.free_symbols
        alone, kinds = expr.free_symbols - set(self.parameters) <= inputs, {*words}
        if alone and kinds == {"zoh"}:
            return "zoh"
        if alone and kinds == {"foh"} and all(sympy.diff(expr, symbol, 2) == 0 for symbol in inputs):
            return "foh"
        return self.rule if kinds <= {"smooth"} else "trapezoid"

    def finished(self) -> Formulas:
        compiled, parameters = self.compiled, self.parameters
        count = len(self.signals)
        slopes_of_signals = []
        for at in range(count):
            expr, kind, late = self.signals[at]
            for k, parameter in enumerate(parameters):
                slope = sympy.diff(expr, parameter)
                found = {c: g for c, d in self.sensitive[at].items() if (g := sympy.diff(d, parameter)) != 0}
                if slope != 0 or found:
                    slopes_of_signals.append((at, k, self._placed(slope, kind, late, found)))
        channels = self._channels()
        # An input whose noise has several spectra stands there as often; each has it as its slope.
        distinct = dict(zip(dict.fromkeys(self.noisy), self.noise, strict=True))
        noise = [distinct[name] for name in self.noisy]
        results = [expr for expr, _, _ in self.signals]
        sensitivities = []
        for at, found in enumerate(self.sensitive):
            for k, channel in enumerate(noise):
                if channel in found:
                    sensitivities.append((at, k))
                    results.append(found[channel])
        own = {c.symbol for c in channels if c.own}
        results, sides = sided(results, compiled, {c.symbol for c in channels}, own)
        channels = (*channels, *(Channel(symbol, "side", of) for symbol, of in sides.items()))
        channels = tuple(sorted(channels, key=lambda c: not c.own))  # batches send the shared ones last
        symbols = [c.symbol for c in channels]
        pairs = [self.common.get(both, sympy.Dummy()) for both in combinations(noise, 2)]
        inputs = [*symbols, *[self.noise[c] for c in noise], *pairs, *parameters]
        slopes, derivatives = [], []
        for at, g in enumerate(self.coefficients):
            for k, parameter in enumerate(parameters):
                if (slope := sympy.diff(g, parameter)) != 0:
                    slopes.append((at, k))
                    derivatives.append(slope)
        late = [self._late(expr) for _, _, expr in self.signals]
        each = zip(self.signals, late, strict=True)
        linear = not slopes_of_signals and all(k is None for _, k in late)
        linear = linear and not any(d.free_symbols for d in derivatives)
        uses_variance = any(v in expr.free_symbols for expr in results for v in self.noise.values())
        free = [compiled.free.get(name, _ANYTHING) for name in compiled.parameters]
        words = {
            "orders": list(compiled.orders),
            "signals": [(kinds, delay, k) for (_, kinds, _), (delay, k) in each],
            "terms": self.terms,
            "coefficients": tape([*self.coefficients, *derivatives], parameters),
            "slopes": slopes,
            "formulas": tape(results, inputs),
            "sensitivities": sensitivities,
            "signal_slopes": slopes_of_signals,
            "channels": len(channels),
            "noisy": [symbols.index(c) for c in noise],
            "starts": [f.start for f in free],
            "near": False,
            "bounds": [(f.min, f.max) for f in free],
            "priors": [(k, *f.prior) for k, f in enumerate(free) if f.prior],
            "linear": linear,
            "levels_matter": uses_variance or len(noise) > 1,
        }
        return Formulas(compiled, words, channels, self.noisy, (results, inputs, self.coefficients))

    def _channels(self) -> tuple[Channel, ...]:
        used: set[sympy.Symbol] = set().union(*(expr.free_symbols for expr, _, _ in self.signals))
        used = used.union(*(d.free_symbols for found in self.sensitive for d in found.values()))
        used |= set(self.noise)
        places = {s: place for s, place in self.times.places.items() if s in used}
        bare = used | {channel for channel, _ in places.values()}
        all_: list[Channel] = []
        for k, name in enumerate(self.compiled.outputs):
            all_.append(Channel(jet(name), "output", k))
            all_.append(Channel(_logarithm(name), "log", k))
        for (expr, derivative, gain), symbol in self.smooth.items():
            all_.append(Channel(symbol, "gain" if gain else "smooth", (expr, derivative, gain)))
        for k, name in enumerate(self.compiled.inputs):
            all_.append(Channel(jet(name), "input", k))
            all_ += [Channel(s, "held", k, held=held) for s, (own, held) in self.held.items() if own == name]
        all_.append(Channel(time, "time"))
        all_ += [Channel(symbol, "known", given) for symbol, given in self.compiled.known.items()]
        kept = {c.symbol: c for c in all_ if c.symbol in bare}
        late = [
            replace(kept[of], symbol=symbol, late=float(by), straight=self._straight(kept[of]))
            for symbol, (of, by) in places.items()
        ]
        return (*(c for symbol, c in kept.items() if symbol in used), *late)

    def _straight(self, channel: Channel) -> tuple[bool, ...]:
        if channel.kind in ("input", "held"):
            name = self.compiled.inputs[channel.of]
            return tuple([words[name] != "smooth" for words in self.forms])
        return (channel.kind == "known",)

    def _late(self, expr: sympy.Expr) -> tuple[float, int | None]:
        if expr in self.parameters:
            return 0.0, self.parameters.index(expr)
        if expr.free_symbols:
            raise SpecError(
                f"fitting an equation: a delay of {expr} is neither a number nor a parameter of its own"
            )
        return float(expr), None


def _slopes(expr: sympy.Expr, channels: dict[sympy.Symbol, sympy.Symbol]) -> dict[sympy.Symbol, sympy.Expr]:
    """Slopes that are not zero, by other names of the channels."""
    return {name: d for name, channel in channels.items() if (d := sympy.diff(expr, channel)) != 0}


def _logarithm(name: str) -> sympy.Symbol:
    return sympy.Symbol(f"log {name}", real=True)


def _held(name: str, held: tuple[bool, ...]) -> sympy.Symbol:
    """What stands for an input where it is held, in all records or in some of them."""
    where = "" if all(held) else " in " + ", ".join(str(k) for k, own in enumerate(held) if own)
    return sympy.Symbol(f"held {jet(name).name}{where}", real=True)
