"""Models as MathML: transfer functions, matrices and equations, from names and numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.html import escape
from ..language.parser import Node, equation, expression
from .parts import Markup

__all__ = ["equations", "state_space", "transfer_functions"]

GREEK = dict(
    alpha="α", beta="β", gamma="γ", delta="δ", epsilon="ε", zeta="ζ", eta="η", theta="θ", kappa="κ", mu="μ",
    nu="ν", xi="ξ", pi="π", rho="ρ", sigma="σ", tau="τ", phi="φ", chi="χ", psi="ψ", omega="ω",
)  # fmt: skip
GREEK["lambda"] = "λ"


# Transfer functions ------------------------------------------------------------------------------


def transfer_functions(fit: Any) -> list[Markup]:
    """Each path of a fitted transfer function, in names and in numbers; of a free motion its equation."""
    found = []
    for i, output in enumerate(fit.outputs):
        den, nums = fit.polynomials(i)
        first = fit.layout.places[0][i]
        names = ["1", *(_named(fit, first + k, den[k + 1]) for k in range(den.size - 1))]
        if not fit.inputs:
            zero = _row(_mo("="), _mn("0"))
            left = [_derivatives(names, output), zero, _mo(";"), _derivatives(_figures(den), output), zero]
            found.append(_block(*left))
        for k, (num, degree) in enumerate(zip(nums, fit.layout.numerators[i], strict=True)):
            if degree is None:
                continue
            at = fit.layout.places[1][i][k]
            above = [_named(fit, at + j, num[j]) for j in range(num.size)]
            gain = _sub(_mi("G"), _text(f"{output}, {fit.inputs[k]}"))
            said = [gain, _row(_mi("(s)", plain=True)), _mo("=")]
            said += [_fraction(_polynomial(above), _polynomial(names)), _late(fit, i, k)]
            if any(fit.layout.positions[j] is not None for j in range(len(fit.layout.positions))):
                numbers = _fraction(_polynomial(_figures(num)), _polynomial(_figures(den)))
                said += [_mo("="), numbers, _late(fit, i, k, number=True)]
            found.append(_block(*said))
    return found


def _named(fit: Any, coefficient: int, value: float) -> str:
    """Name of a coefficient, or its number where it is held."""
    at = fit.layout.positions[coefficient]
    return _number(value) if at is None else _name(fit.layout.names[coefficient])


def _late(fit: Any, output: int, k: int, number: bool = False) -> str:
    path = fit.layout.paths[fit.layout.routes[output][k]]
    late = fit.layout.delays(fit.params, output)[k]
    if late == 0 and isinstance(path.delay, int | float):
        return ""
    known = number or isinstance(path.delay, int | float)
    exponent = _row(_mo("−"), _number(late) if known else _name(path.name), _mi("s"))
    return f"<msup>{_mi('e')}{exponent}</msup>"


def _figures(values: F64) -> list[str]:
    return [_number(value) for value in values]


def _polynomial(coefficients: Sequence[str]) -> str:
    """Coefficients in descending powers of s; ones before powers and zeros are left out."""
    terms: list[str] = []
    degree = len(coefficients) - 1
    for k, coefficient in enumerate(coefficients):
        power = degree - k
        terms += _term(coefficient, _power(_mi("s"), power) if power else "", bool(terms))
    return _row(*terms) if terms else _mn("0")


def _derivatives(coefficients: Sequence[str], signal: str) -> str:
    terms: list[str] = []
    degree = len(coefficients) - 1
    for k, coefficient in enumerate(coefficients):
        terms += _term(coefficient, _primed(_text(signal), degree - k), bool(terms))
    return _row(*terms)


def _term(coefficient: str, factor: str, follows: bool) -> list[str]:
    if coefficient in (_mn("0"), _mn("0.0")):
        return []
    minus = coefficient.startswith(_mo("−"))
    size = coefficient.removeprefix(_mo("−"))
    sign = [_mo("−")] if minus else [_mo("+")] if follows else []
    one = size in ("1", _mn("1")) and factor
    return [*sign, *([] if one else [_mn("1") if size == "1" else size]), factor]


# State space -------------------------------------------------------------------------------------


def state_space(model: Any, values: Mapping[str, float]) -> list[Markup]:
    """The matrices of a `StateSpace` in names, and with the estimates."""
    left = _row(_primed(_mi("x"), 1), _mo("="), _mi("A"), _mi("x"), _mo("+"), _mi("B"), _mi("u"))
    right = _row(_mi("y"), _mo("="), _mi("C"), _mi("x"), _mo("+"), _mi("D"), _mi("u"))
    order = [
        _row(_mi(name), _mo("="), _vector([_text(one) for one in own]))
        for name, own in (("x", model.states), ("u", model._drives), ("y", model.outputs))
        if own
    ]
    lines = [_block(left, _mo(","), right), _block(*(part for one in order for part in (one, _mo(" "))))]
    for name in "ABCD":
        matrix = getattr(model, name)
        if not matrix or not matrix[0]:
            continue
        rows = [[_entry(one) for one in row] for row in matrix]
        said = [_mi(name), _mo("="), _matrix(rows)]
        if any(isinstance(one, str) for row in matrix for one in row):
            numbers = [[_entry(one, values) for one in row] for row in matrix]
            said += [_mo("="), _matrix(numbers)]
        lines.append(_block(*said))
    return lines


def _entry(given: Any, values: Mapping[str, float] | None = None) -> str:
    if not isinstance(given, str):
        return _number(float(given))
    if values is not None and given in values:
        return _number(values[given])
    return _Tree(expression(given).text, values or {}).show(expression(given).tree)


def _vector(entries: Sequence[str]) -> str:
    return _matrix([[entry] for entry in entries])


def _matrix(rows: Sequence[Sequence[str]]) -> str:
    cells = "".join(f"<mtr>{''.join(f'<mtd>{one}</mtd>' for one in row)}</mtr>" for row in rows)
    return f"<mrow>{_mo('[')}<mtable>{cells}</mtable>{_mo(']')}</mrow>"


# Equations ---------------------------------------------------------------------------------------


def equations(texts: Sequence[str], values: Mapping[str, float]) -> list[Markup]:
    """Equations as they were written, and with the estimates for the parameters."""
    found = []
    for text in texts:
        tree = equation(text).tree
        left, right = tree.parts[0], tree.parts[1].parts[0]
        for numbers in ({}, values) if values else ({},):
            shown = _Tree(text, numbers)
            found.append(_block(shown.show(left), _mo("="), shown.show(right)))
    return found


class _Tree:
    """A tree of the parser as MathML; names in `values` are shown as numbers."""

    def __init__(self, text: str, values: Mapping[str, float]) -> None:
        self.text, self.values = text, values

    def show(self, node: Node) -> str:
        make = getattr(self, f"_{node.kind}", None)
        return _text(self.text[node.at : node.end]) if make is None else str(make(node))

    def _number(self, node: Node) -> str:
        return _number(float(node.value))

    def _name(self, node: Node) -> str:
        if node.value in self.values and not node.primes:
            return _number(self.values[node.value], brackets=True)
        own = _primed(_name(str(node.value)), node.primes)
        return _row(own, *(_brackets(self.show(part)) for part in node.parts))

    def _sum(self, node: Node) -> str:
        said: list[str] = []
        for part in node.parts:
            if part.kind == "negative":
                said += [_mo("−"), self._inside(part.parts[0], ("sum", "negative"))]
            else:
                said += [*([_mo("+")] if said else []), self.show(part)]
        return _row(*said)

    def _negative(self, node: Node) -> str:
        return _row(_mo("−"), self._inside(node.parts[0], ("sum", "negative")))

    def _product(self, node: Node) -> str:
        above = [part for part in node.parts if part.kind != "inverse"]
        below = [part.parts[0] for part in node.parts if part.kind == "inverse"]
        top = self._times(above) if above else _mn("1")
        return _fraction(top, self._times(below)) if below else top

    def _times(self, parts: Sequence[Node]) -> str:
        said: list[str] = []
        for part in parts:
            alone = ("sum", "negative", "compare") if len(parts) > 1 else ()
            said += [*([_mo("⋅")] if said else []), self._inside(part, alone)]
        return _row(*said)

    def _inverse(self, node: Node) -> str:
        return _fraction(_mn("1"), self.show(node.parts[0]))

    def _power(self, node: Node) -> str:
        base, exponent = node.parts
        signal = base.kind == "name" and not base.primes and base.value not in self.values
        own = self.show(base) if signal or base.kind == "number" else _brackets(self.show(base))
        return f"<msup>{own}{_row(self.show(exponent))}</msup>"

    def _prime(self, node: Node) -> str:
        return _primed(_brackets(self.show(node.parts[0])), int(node.value))

    def _call(self, node: Node) -> str:
        parts = [self.show(part) for part in node.parts]
        if node.value == "sqrt":
            return f"<msqrt>{parts[0]}</msqrt>"
        if node.value == "abs":
            return _row(_mo("|"), parts[0], _mo("|"))
        listed = [piece for k, part in enumerate(parts) for piece in ((_mo(","), part) if k else (part,))]
        return _row(_mi(str(node.value), plain=True), _brackets(_row(*listed)))

    def _inside(self, node: Node, kinds: tuple[str, ...]) -> str:
        return _brackets(self.show(node)) if node.kind in kinds else self.show(node)


# Letters -----------------------------------------------------------------------------------------


def _block(*parts: str) -> Markup:
    return Markup(f'<math display="block">{_row(*parts)}</math>')


def _row(*parts: str) -> str:
    return f"<mrow>{''.join(parts)}</mrow>"


def _mn(text: str) -> str:
    return f"<mn>{escape(text)}</mn>"


def _mo(text: str) -> str:
    return f"<mo>{escape(text)}</mo>"


def _mi(text: str, plain: bool = False) -> str:
    return f'<mi mathvariant="normal">{escape(text)}</mi>' if plain else f"<mi>{escape(text)}</mi>"


def _text(text: str) -> str:
    return f"<mtext>{escape(text)}</mtext>"


def _sub(base: str, index: str) -> str:
    return f"<msub>{base}{index}</msub>"


def _power(base: str, power: int) -> str:
    return base if power == 1 else f"<msup>{base}{_mn(str(power))}</msup>"


def _primed(base: str, primes: int) -> str:
    if not primes:
        return base
    if primes <= 3:
        return f'<mrow>{base}<mo lspace="0.05em" rspace="0.1em">{"′" * primes}</mo></mrow>'
    return f"<msup>{base}{_row(_mo('('), _mn(str(primes)), _mo(')'))}</msup>"


def _fraction(above: str, below: str) -> str:
    return f"<mfrac>{_row(above)}{_row(below)}</mfrac>"


def _brackets(inner: str) -> str:
    return _row(_mo("("), inner, _mo(")"))


def _name(name: str) -> str:
    """A parameter or signal: a1 and b0[q,de] with indices, words of Greek letters as these."""
    stem, bracket, channels = name.partition("[")
    letters = stem.rstrip("0123456789")
    number = stem[len(letters) :]
    head, _, tail = letters.partition("_")
    index = ", ".join(part for part in (tail + number, channels.removesuffix("]") if bracket else "") if part)
    own = GREEK.get(head, head)
    base = _mi(own) if head else _text(name)
    return _sub(base, _text(index)) if head and index else base


def _number(value: float, brackets: bool = False) -> str:
    """Five digits; powers of ten where a number is far from one."""
    if not np.isfinite(value):
        return _text(str(value))
    digits, _, exponent = f"{abs(value):.5g}".partition("e")
    sign = _mo("−") if value < 0 else ""
    said = _mn(digits)
    if exponent:
        ten = f"<msup>{_mn('10')}{_row(_mn(str(int(exponent))))}</msup>"
        said = _row(said, _mo("×"), ten)
    if brackets and (sign or exponent):
        return _brackets(sign + said)
    return sign + said
