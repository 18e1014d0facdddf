"""Texts of equations as formulas of LaTeX: with the names of parameters, or numbers in their places."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from math import floor, isfinite, log10

import sympy

from ...language.parser import expression
from .compiled import jet, time
from .jets import Moving, base, order
from .meaning import meaning, parameter

__all__ = ["aligned", "latex_of", "rounded", "written"]

EQUALS = re.compile(r"(?<![<>])=")
WORD = re.compile(r"^([A-Za-z]{2,})(?=$|_)")
# A number less than zero in parentheses: at the head of a term its sign is that of the term.
NEGATIVE = r"\\left\(-([^()]*)\\right\)(?!\^)"
SIGNS = (
    (rf"\+ {NEGATIVE}", r"- \1"),
    (rf"- {NEGATIVE}", r"+ \1"),
    (rf"(^|{{|\\left\(){NEGATIVE}", r"\1-\2"),
)


def latex_of(
    text: str,
    channels: Iterable[str],
    numbers: Mapping[str, str] | None = None,
    varying: Iterable[str] = (),
) -> str:
    """A term or a side of an equation as LaTeX, derivatives with dots, parameters before channels.

    Parameters
    ----------
    text : str
    channels : iterable of str
    numbers : mapping of str to str, optional
        What stands in the place of parameters.
    varying : iterable of str, optional
        Coefficients c(t).
    """
    moving, texts = Moving({*channels}), numbers or {}
    functions = {name: sympy.Function(name)(time) for name in varying}
    expr = meaning(expression(text, "term"), moving, varying=functions)
    names, first = {}, {}
    for symbol in sorted(expr.free_symbols, key=str):
        if moving.is_channel(symbol):
            names[symbol] = _dotted(symbol, moving, texts)
        elif symbol != time:
            # Factors stand in the order of their names.
            own = first[symbol] = sympy.Symbol(f"!{symbol.name}", real=True)
            names[own] = _name(symbol, texts)
    said = str(sympy.latex(expr.xreplace(first), symbol_names=names, order="none"))
    for pattern, sign in SIGNS if texts else ():
        said = re.sub(pattern, sign, said)
    # Numbers side by side would read as one.
    return re.sub(r"(?<=\d) (?=\d|\\left\(-)", r" \\cdot ", said).removeprefix("+ ")


def written(
    texts: Sequence[str],
    channels: Iterable[str],
    numbers: Mapping[str, str] | None = None,
    varying: Iterable[str] = (),
) -> str:
    """Equations as aligned lines; see `latex_of`."""
    sides = [
        [latex_of(side, channels, numbers, varying) for side in EQUALS.split(text, maxsplit=1)]
        for text in texts
    ]
    return aligned(" &= ".join(both if len(both) == 2 else [*both, "0"]) for both in sides)


def aligned(rows: Iterable[str]) -> str:
    """Lines of mathematics with & where they are aligned."""
    return "\\begin{aligned}\n" + " \\\\\n".join(rows) + "\n\\end{aligned}"


def rounded(value: float, error: float) -> str:
    """A number with two significant digits of its standard error, or with four where there is none."""
    if error > 0 and isfinite(error):
        return f"{value:.{max(0, 1 - floor(log10(error)))}f}"
    head, _, power = f"{value:.4g}".partition("e")
    return rf"{head} \cdot 10^{{{int(power)}}}" if power else head


def _name(symbol: sympy.Symbol, numbers: Mapping[str, str]) -> str:
    number = numbers.get(symbol.name)
    if number is None:
        return _upright(str(sympy.latex(parameter(symbol.name))))
    return rf"\left({number}\right)" if number.startswith("-") or r"\cdot" in number else number


def _upright(name: str) -> str:
    """A name of several letters as one word: in italics it would read as a product."""
    return WORD.sub(r"\\mathrm{\1}", name)


def _dotted(symbol: sympy.Symbol, moving: Moving, numbers: Mapping[str, str]) -> str:
    count, own = order(symbol), base(symbol)
    name, late = moving.delays.get(own, (own, None))
    said = _upright(str(sympy.latex(jet(name))))
    if count > 3:
        said = f"{said}^{{({count})}}"
    elif count:
        said = rf"\{'d' * count}ot{{{said}}}"
    if late is None:
        return said
    return rf"{said}\left(t - {_name(late, numbers) if late.is_Symbol else sympy.latex(late)}\right)"
