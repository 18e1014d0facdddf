"""Antiderivatives with respect to one symbol, from a closed table: fast, or none."""

from __future__ import annotations

import sympy

__all__ = ["antiderivative"]

MOST_DEGREE = 4  # of quotients of polynomials that SymPy integrates

_LINEAR = {
    sympy.sin: lambda x: -sympy.cos(x),
    sympy.cos: sympy.sin,
    sympy.exp: sympy.exp,
    sympy.sinh: sympy.cosh,
    sympy.cosh: sympy.sinh,
    sympy.tan: lambda x: -sympy.log(sympy.cos(x)),
    sympy.tanh: lambda x: sympy.log(sympy.cosh(x)),
    sympy.log: lambda x: x * sympy.log(x) - x,
    sympy.atan: lambda x: x * sympy.atan(x) - sympy.log(1 + x**2) / 2,
    sympy.sign: sympy.Abs,
    sympy.Abs: lambda x: x * sympy.Abs(x) / 2,
}


def antiderivative(expr: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """∫ expr dx, or None where the table has none.

    Parameters
    ----------
    expr : Expr
    x : Symbol
    """
    total = sympy.S.Zero
    for term in sympy.Add.make_args(expr):
        still, moving = term.as_independent(x, as_Add=False)
        found = _of_product(moving, x)
        if found is None:
            return None
        total += still * found
    return total


def _of_product(f: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    if f == 1:
        return x
    powers = f.as_powers_dict()
    if all(b in (x, sympy.Abs(x), sympy.sign(x)) and not n.has(x) for b, n in powers.items()):
        return _of_powers(powers, x)
    if len(powers) == 1:
        ((inner, n),) = powers.items()
        if not n.has(x) and (slope := _slope(inner, x)) is not None:  # (a x + b)^n
            return (sympy.log(inner) if n == -1 else inner ** (n + 1) / (n + 1)) / slope
        if f.func in _LINEAR and (slope := _slope(f.args[0], x)) is not None:
            return _LINEAR[f.func](f.args[0]) / slope
    return _of_rational(f, x) if f.is_rational_function(x) else _by_parts(f, x)


def _of_rational(f: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """∫ of c d'/d^n, of partial fractions with linear denominators, and of low degrees with numbers."""
    over, below = sympy.fraction(sympy.factor(f))
    if not below.has(x):
        return None
    root, n = below.as_independent(x, as_Add=False)[1].as_base_exp()
    scale = sympy.cancel(over / below * root**n / sympy.diff(root, x))
    if not scale.has(x):
        return scale * (sympy.log(root) if n == 1 else root ** (1 - n) / (1 - n))
    parts = sympy.Add.make_args(sympy.apart(f, x))
    if len(parts) > 1:
        found = [_of_product(p.as_independent(x, as_Add=False)[1], x) for p in parts]
        stills = [p.as_independent(x, as_Add=False)[0] for p in parts]
        return None if None in found else sympy.Add(*(s * p for s, p in zip(stills, found, strict=True)))
    if f.free_symbols != {x} or max(sympy.degree(over, x), sympy.degree(below, x)) > MOST_DEGREE:
        return None
    found = sympy.integrals.rationaltools.ratint(f, x)
    return None if found.has(sympy.Integral, sympy.RootSum, sympy.I) else found


def _of_powers(powers: dict[sympy.Expr, sympy.Expr], x: sympy.Symbol) -> sympy.Expr:
    """∫ x^n |x|^m sign(x)^k, k 0 or 1."""
    n, m = powers.get(x, sympy.S.Zero), powers.get(sympy.Abs(x), sympy.S.Zero)
    if powers.get(sympy.sign(x), 0):
        n, m = n - 1, m + 1
    if n + m == -1:
        return sympy.log(x) if m == 0 else x**n * sympy.Abs(x) ** m * x * sympy.log(x)
    return x ** (n + 1) * sympy.Abs(x) ** m / (n + m + 1)


def _by_parts(f: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    """∫ x^n g(a x + b), n a whole number and g with antiderivatives in the table."""
    powers = f.as_powers_dict()
    n = powers.get(x, sympy.S.Zero)
    rest = f / x**n
    if not (n.is_Integer and 0 < n <= 8 and rest.func in (sympy.sin, sympy.cos, sympy.exp, sympy.log)):
        return None
    if (slope := _slope(rest.args[0], x)) is None:
        return None
    if rest.func == sympy.log:
        if rest.args[0] != slope * x:
            return None
        return x ** (n + 1) / (n + 1) * rest - x ** (n + 1) / (n + 1) ** 2
    inner = _LINEAR[rest.func](rest.args[0]) / slope
    lower = antiderivative(sympy.expand(n * x ** (n - 1) * inner), x)
    return None if lower is None else x**n * inner - lower


def _slope(inner: sympy.Expr, x: sympy.Symbol) -> sympy.Expr | None:
    slope = sympy.diff(inner, x)
    return None if slope.has(x) or slope == 0 else slope
