"""Sizes that equations ask of their parameters: all terms of a sum are of one size."""

from __future__ import annotations

from collections.abc import Sequence
from math import log, pi
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..language.parser import Node
from ..records.record import Record

__all__ = ["sizes"]

MOST_OF = 0.9  # of a signal's power lies below its frequency
LARGEST = 50.0  # logarithm of a size
ALIKE = ("abs", "min", "max", "floor")
STEPS = ("step", "sign", "where")  # which say nothing of what stands in them


def sizes(model: Any, names: Sequence[str], records: Sequence[Record]) -> F64:
    """Size of each parameter of equations: least squares of logarithms, 1 where nothing tells it."""
    known = {name: log(abs(given)) for name, given in model.params if isinstance(given, float) and given}
    for name in (*model.outputs, *model.inputs):
        rms = float(np.sqrt(np.mean([np.nanmean(rec[name] ** 2) for rec in records])))
        known[name] = log(rms) if rms > 0 else 0.0
    known["t"] = log(max([rec.duration for rec in records]))
    known["pi"] = log(pi)
    balance = _Balance(known, log(_speed(records)))
    for text in model.parsed:
        balance.of(text.tree)
    found = balance.solved()
    logs: F64 = np.clip([found.get(name, 0.0) for name in names], -LARGEST, LARGEST)
    return np.asarray(np.exp(logs))


def _speed(records: Sequence[Record]) -> float:
    """Of the fastest output, rad/s: most of its power about a straight line lies below."""
    speeds = []
    for rec in records:
        n, omega0 = rec.t.size, 2 * pi / rec.duration
        for y in rec.y:
            even = np.interp(np.linspace(rec.t[0], rec.t[-1], n), rec.t, np.where(np.isfinite(y), y, 0.0))
            even -= np.linspace(even[0], even[-1], n)
            power = np.cumsum(np.abs(np.fft.rfft(even)[1:]) ** 2)
            at = int(np.searchsorted(power, MOST_OF * power[-1])) if power[-1] > 0 else 0
            speeds.append((at + 1) * omega0)
    return float(max(speeds))


class _Balance:
    """Linear equations in logarithms of sizes."""

    def __init__(self, known: dict[str, float], speed: float) -> None:
        self.known, self.speed = known, speed
        self.rows: list[tuple[dict[str, float], float]] = []

    def of(self, node: Node) -> tuple[dict[str, float], float]:
        """The logarithm of a node's size: what it holds of each unknown, and a number."""
        kind, parts = node.kind, [self.of(part) for part in node.parts]
        if kind == "number":
            value = abs(float(node.value))
            return {}, log(value) if value else 0.0
        if kind == "name":
            over = node.primes * self.speed
            own = self.known.get(str(node.value))
            return ({str(node.value): 1.0}, over) if own is None else ({}, own + over)
        if kind in ("sum", "compare", "mod") or node.value in ALIKE:
            parts = [part for own, part in zip(node.parts, parts, strict=True) if not _zero(own)]
            for part in parts[1:]:
                self._same(parts[0], part)
            return parts[0] if parts else ({}, 0.0)
        if kind == "prime" or node.value == "D":
            often = int(node.value) if kind == "prime" else _order(node)
            return parts[0][0], parts[0][1] + often * self.speed
        if kind == "negative":
            return parts[0]
        if kind == "inverse":
            return _times(parts[0], -1.0)
        if kind == "product":
            total: dict[str, float] = {}
            for powers, _ in parts:
                for name, power in powers.items():
                    total[name] = total.get(name, 0.0) + power
            return total, sum(number for _, number in parts)
        if kind == "power":
            exponent = node.parts[1]
            if exponent.kind == "number":
                return _times(parts[0], float(exponent.value))
            self._same(parts[1], ({}, 0.0))
            return parts[0]
        if node.value == "sqrt":
            return _times(parts[0], 0.5)
        if parts and node.value not in STEPS:  # what stands in other functions is of the order of 1
            self._same(parts[0], ({}, 0.0))
        return {}, 0.0

    def _same(self, one: tuple[dict[str, float], float], other: tuple[dict[str, float], float]) -> None:
        names = {*one[0], *other[0]}
        row = {name: one[0].get(name, 0.0) - other[0].get(name, 0.0) for name in names}
        if any(row.values()):
            self.rows.append((row, other[1] - one[1]))

    def solved(self) -> dict[str, float]:
        """The least squares of least norm."""
        names = sorted({name for row, _ in self.rows for name in row})
        if not names:
            return {}
        matrix = np.array([[row.get(name, 0.0) for name in names] for row, _ in self.rows])
        found = np.linalg.lstsq(matrix, np.array([value for _, value in self.rows]), rcond=None)[0]
        return dict(zip(names, found.tolist(), strict=True))


def _zero(node: Node) -> bool:
    """Whether a node is the number 0, which is of every size."""
    inner = node.parts[0] if node.kind == "negative" else node
    return inner.kind == "number" and float(inner.value) == 0


def _order(call: Node) -> int:
    """Of D(expression, order)."""
    order = call.parts[1] if len(call.parts) > 1 else None
    return int(order.value) if order is not None and order.kind == "number" else 1


def _times(one: tuple[dict[str, float], float], by: float) -> tuple[dict[str, float], float]:
    return {name: power * by for name, power in one[0].items()}, one[1] * by
