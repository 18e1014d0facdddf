"""Texts to trees, with one closed list of functions for equations and signals; nothing of a text is run."""

from __future__ import annotations

import keyword
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Any, NoReturn

import numpy as np

from ..errors import SpecError

__all__ = ["CONSTANTS", "EULER", "FUNCTIONS", "Node", "Text", "equation", "expression", "separated"]

# The functions of texts everywhere in modfun: how many arguments they take, and what they are of numbers.
FUNCTIONS: dict[str, tuple[int, Callable[..., Any]]] = {
    "sin": (1, np.sin),
    "cos": (1, np.cos),
    "tan": (1, np.tan),
    "asin": (1, np.arcsin),
    "acos": (1, np.arccos),
    "atan": (1, np.arctan),
    "sinh": (1, np.sinh),
    "cosh": (1, np.cosh),
    "tanh": (1, np.tanh),
    "exp": (1, np.exp),
    "log": (1, np.log),
    "log10": (1, np.log10),
    "sqrt": (1, np.sqrt),
    "abs": (1, np.abs),
    "sign": (1, np.sign),
    "floor": (1, np.floor),
    "step": (1, lambda x: np.heaviside(x, 1.0)),
    "min": (2, np.minimum),
    "max": (2, np.maximum),
    "where": (3, lambda c, a, b: np.where(c != 0, a, b)),
}
CONSTANTS = {"pi": np.float64(np.pi), "e": np.float64(np.e)}
EULER = (
    "may be a power of a parameter or of Euler's number: take another name for a parameter, and write "
    "exp(...) for the exponential"
)
_SIGNS = "numbers, + - * / ** % < <= > >=, parentheses"
_CALLS = ", ".join(FUNCTIONS)
ALLOWED = f"allowed are signals with primes, parameters, t, pi, {_SIGNS}, D(expression, order) and {_CALLS}"

# Of an equation, and of an expression in given names, for which a function may be given as well.
MOST_CHARACTERS, MOST_DEPTH = 2000, 60
MOST_LISTED = 20_000  # characters of a list
_MOST_CHARACTERS_NAMED, _MOST_DEPTH_NAMED = 1000, 200
MOST_PRIMES = 12

_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z][A-Za-z0-9_]*)"
    r"|(?P<op>\*\*|<=|>=|==|//|[-+*/%()<>=,'])|(?P<end>$)|(?P<other>_\w*|.))",
    re.ASCII | re.DOTALL,
)
_HINTS = {
    "^": "is not an operator: a power is written **",
    "//": "is an unknown operator: a quotient is written /",
    "’": "is not a prime: a derivative is written with the apostrophe, y'",
    "′": "is not a prime: a derivative is written with the apostrophe, y'",
    '"': "is not a prime: a second derivative is written with two apostrophes, y''",
    "==": "is written =",
}
_HINTS_NAMED = {name: _HINTS[name] for name in ("^", "//")} | {
    "==": "is an unknown comparison",
    "'": "is not part of the language",
}


@dataclass(frozen=True)
class Node:
    """A piece of a text: what it is, where it stands, and its parts.

    Attributes
    ----------
    kind : str
        "number", "name", "call", "prime", "sum", "product", "negative", "inverse", "power", "mod" or
        "compare".
    at, end : int
        The piece is text[at:end].
    value : object
        The number as text, the name, the function, the count of primes, the comparison.
    primes : int
        Of a name: y' has one.
    parts : tuple of Node
        Operands and arguments; of a name what stands in its parentheses, as in y(t - h).
    """

    kind: str
    at: int
    end: int
    value: Any = None
    primes: int = 0
    parts: tuple[Node, ...] = ()

    def walk(self) -> Iterator[Node]:
        """This node and all below, in the order of the text."""
        yield self
        for part in self.parts:
            yield from part.walk()

    @property
    def is_exponential(self) -> bool:
        """Whether it is e**x, in which e is rather Euler's number than a parameter."""
        if self.kind != "power" or (self.parts[0].kind, self.parts[0].value) != ("name", "e"):
            return False
        return any(node.kind == "name" for node in self.parts[1].walk())


@dataclass(frozen=True)
class Text:
    """A text with its tree, and the way errors about it are worded.

    Attributes
    ----------
    text : str
    what : str
        "equation", or what else it is.
    names : tuple of str, optional
        All that may stand in it besides constants and functions; None: whoever reads the tree says.
    tree : Node
        Of an equation its left side less its right side.
    """

    text: str
    what: str
    names: tuple[str, ...] | None = None
    tree: Node = field(default=Node("number", 0, 0, "0"))

    def refuse(self, at: int, end: int, reason: str) -> NoReturn:
        """Raise the SpecError that names the piece of text at fault, and its place or what is allowed."""
        piece = self.text[at:end].strip() or "the end"
        shown = self.text if len(self.text) <= 80 else self.text[:77] + "..."
        said = f"{piece[:40]!r} at character {at + 1} {reason}"
        if self.names is not None:
            names = ", ".join((*self.names, *CONSTANTS))
            said = f"{piece[:40]!r} {reason}; allowed are {names}, {_SIGNS} and {_CALLS}"
        raise SpecError(f"reading the {self.what} {shown!r}: {said}") from None


def equation(text: Any, what: str = "equation") -> Text:
    """Parse "left = right".

    Raises
    ------
    SpecError
        Text outside the language: what is at fault, where it stands, and what to write instead.
    """
    reader = _Reader(text, what)
    if reader.kind == "end":
        reader.refuse('is all there is: the text is empty; write an equation, as "y\' + a*y = b*u"')
    left = reader.sum(0)
    if reader.kind == "end":
        reader.refuse("stands where = was expected: the equation has no right side; write = 0")
    reader.expect("=", "an operator or = was expected")
    right = reader.sum(0)
    reader.finish()
    minus = Node("negative", right.at, right.end, parts=(right,))
    return Text(text, what, tree=Node("sum", 0, len(text), parts=(left, minus)))


def expression(text: Any, what: str = "expression", names: Sequence[str] | None = None) -> Text:
    """Parse an expression, in the language of `equation`.

    With `names`, these, constants and functions are all that may stand in it: no primes, no D(...), no calls
    of names. It may then be nested deeper, and is refused in words that list what is allowed.
    """
    reader = _Reader(text, what, names)
    tree = reader.comparison(0)
    reader.finish()
    return Text(text, what, reader.names, tree)


def separated(text: Any, what: str = "list") -> tuple[str, ...]:
    """The expressions between the commas of a text, in the language of `equation`."""
    reader, found = _Reader(text, what, most=MOST_LISTED), []
    while reader.kind != "end":
        if not reader.take(","):
            at = reader.at
            reader.comparison(0)
            found.append(text[at : reader.last].strip())
            if reader.kind != "end" and reader.token != ",":
                reader.finish()
    return tuple(found)


class _Reader:
    """Recursive descent over the tokens; chains of + and * are flat, so that depth is that of parentheses."""

    def __init__(
        self, text: Any, what: str, names: Sequence[str] | None = None, most: int | None = None
    ) -> None:
        if not isinstance(text, str):
            raise SpecError(f"reading the {what}: expected text, got {type(text).__name__}")
        self.names = None if names is None else tuple(names)
        self.source = Text(text, what, self.names)
        self.hints = _HINTS if names is None else _HINTS_NAMED
        self.listed = f"; {ALLOWED}" if names is None else ""  # else `Text.refuse` says it of everything
        self.deepest = MOST_DEPTH if names is None else _MOST_DEPTH_NAMED
        cure = "write it as several texts" if names is None else "pass a function instead"
        most = most or (MOST_CHARACTERS if names is None else _MOST_CHARACTERS_NAMED)
        if len(text) > most:
            raise SpecError(
                f"reading the {what}: it has {len(text)} characters, at most {most} are read; {cure}"
            )
        self.text = text
        self.next = 0
        self.last = 0  # end of the token before this one
        self.advance()

    def advance(self) -> None:
        self.last = self.next
        found = _TOKEN.match(self.text, self.next)
        assert found is not None  # "other" takes what nothing else does
        self.kind = str(found.lastgroup)
        self.token = found[self.kind]
        self.at, self.next = found.start(self.kind), found.end()
        if self.token in self.hints:
            self.refuse(self.hints[self.token])
        if self.kind == "other":
            self.refuse(f"is not part of the language (names are of letters a-z, digits and _){self.listed}")

    def refuse(self, reason: str) -> NoReturn:
        self.source.refuse(self.at, self.next, reason)

    def take(self, *tokens: str) -> str | None:
        if self.kind == "op" and self.token in tokens:
            taken = self.token
            self.advance()
            return taken
        return None

    def expect(self, token: str, reason: str) -> None:
        if not self.take(token):
            if self.kind in ("name", "number") or self.token == "(":
                reason += " (a product is written with *)"
            self.refuse(f"stands where {reason}")

    def finish(self) -> None:
        if self.token == "=":
            self.refuse("is one = too many; give several equations as a list of texts")
        if self.kind != "end":
            self.expect("end", "an operator or the end was expected")

    def deeper(self, depth: int) -> int:
        if depth >= self.deepest:
            cure = "name a part of it by an equation of its own"
            cure = cure if self.names is None else "pass a function instead"
            self.refuse(f"is nested more than {self.deepest} deep; {cure}")
        return depth + 1

    def comparison(self, depth: int) -> Node:
        left = self.sum(depth)
        found: list[Node] = []
        while sign := self.take("<", "<=", ">", ">="):  # 1 < t < 3 is (1 < t)*(t < 3)
            right = self.sum(depth)
            found.append(Node("compare", left.at, self.last, sign, parts=(left, right)))
            left = right
        if len(found) > 1:
            return Node("product", found[0].at, self.last, parts=tuple(found))
        return found[0] if found else left

    def sum(self, depth: int) -> Node:
        at, parts = self.at, [self.product(self.deeper(depth))]
        while sign := self.take("+", "-"):
            part = self.product(depth + 1)
            parts.append(part if sign == "+" else Node("negative", part.at, part.end, parts=(part,)))
        return parts[0] if len(parts) == 1 else Node("sum", at, self.last, parts=tuple(parts))

    def product(self, depth: int) -> Node:
        at, parts = self.at, [self.signed(self.deeper(depth))]
        while sign := self.take("*", "/", "%"):
            part = self.signed(depth + 1)
            if sign == "%":
                left = parts[0] if len(parts) == 1 else Node("product", at, self.last, parts=tuple(parts))
                parts = [Node("mod", at, self.last, parts=(left, part))]
                depth = self.deeper(depth)
            else:
                parts.append(part if sign == "*" else Node("inverse", part.at, part.end, parts=(part,)))
        return parts[0] if len(parts) == 1 else Node("product", at, self.last, parts=tuple(parts))

    def signed(self, depth: int) -> Node:
        at = self.at
        if sign := self.take("+", "-"):
            part = self.signed(self.deeper(depth))
            return part if sign == "+" else Node("negative", at, self.last, parts=(part,))
        base = self.primed(depth)
        if self.take("**"):
            exponent = self.signed(self.deeper(depth))
            return Node("power", at, self.last, parts=(base, exponent))
        return base

    def primed(self, depth: int) -> Node:
        at, inner = self.at, self.atom(depth)
        primes = self.primes()
        return Node("prime", at, self.last, primes, parts=(inner,)) if primes else inner

    def primes(self) -> int:
        count = 0
        while self.token == "'":
            count += 1
            if count > MOST_PRIMES:
                self.refuse(f"is one prime too many; at most {MOST_PRIMES} are read")
            self.advance()
        return count

    def atom(self, depth: int) -> Node:
        at, token = self.at, self.token
        if self.kind == "number":
            if not isfinite(float(token)) or (
                float(token) == 0 and token.lower().partition("e")[0].strip("0.")
            ):
                self.refuse("is outside the range of floating point, which ends at 1e308")
            self.advance()
            return Node("number", at, self.last, token)
        if self.kind == "name":
            return self.name(depth)
        if self.take("("):
            inner = self.comparison(self.deeper(depth))
            self.expect(")", "an operator or ) was expected")
            return inner
        if self.kind == "end":
            self.refuse(f"stands where something was expected{self.listed}")
        self.refuse("stands where a name, a number or ( was expected")

    def name(self, depth: int) -> Node:
        at, name = self.at, self.token
        if keyword.iskeyword(name):
            cure = "is a word of Python, which no signal or parameter may be called; take another"
            self.refuse(cure if self.names is None else "is not part of the language")
        self.advance()
        called = name in FUNCTIONS or (name == "D" and self.names is None)
        primes = self.primes()
        if self.token != "(":
            if called and name != "D":  # alone D is a parameter, as the dilution rate of a reactor
                self.source.refuse(at, self.last, f"is a function: write {name}(...)")
            if self.names is not None and name not in (*self.names, *CONSTANTS):
                self.source.refuse(at, self.last, "is not a known name")
            return Node("name", at, self.last, name, primes)
        if self.names is not None and not called:
            self.source.refuse(at, self.last, "is not a known function")
        if called and primes:
            self.source.refuse(at, self.last, f"is a function with a prime: write ({name}(...))'")
        self.advance()
        parts = [self.comparison(self.deeper(depth))]
        while self.take(","):
            parts.append(self.comparison(depth + 1))
        self.expect(")", "an operator, a comma or ) was expected")
        if not called:
            if len(parts) != 1 or name in (*CONSTANTS, "t"):
                self.source.refuse(at, self.last, f"is not a known function{self.listed}")
            return Node("name", at, self.last, name, primes, parts=tuple(parts))
        wanted = (1, 2) if name == "D" else (FUNCTIONS[name][0],)
        if len(parts) not in wanted:
            takes = "D(expression) or D(expression, order)" if name == "D" else f"{name} takes {wanted[0]}"
            self.source.refuse(at, self.last, f"has {len(parts)} argument(s): {takes}")
        return Node("call", at, self.last, name, parts=tuple(parts))
