"""Processor seconds to compile each Equation of the gallery and the harder cases beside it, SymPy loaded."""

import os
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import gallery
import modfun as mf
import sympy

MOST = 0.5  # s, what an equation may take
FITZHUGH = ["v' = c*(v - v**3/3 + r) + u", "r' = -(v - a + b*r)/c"]
LORENZ = ["x' = s*(z - x)", "z' = x*(r - w) - z", "w' = x*z - b*w"]
TANKS = ["h1' = -k1*sqrt(h1) + k2*u", "h2' = k1*sqrt(h1) - k3*sqrt(h2)"]
FLOW = [
    "alpha' = q - La*alpha - Lw*w",
    "q' = Ma*alpha + Mq*q + Mw*w + Md*de",
    "w' = -b*w + c*alpha' + c2*alpha**2",
]
CHAIN = ["x1' = -k1*x1 + k2*u", "x2' = k1*x1 - k3*x2", "x3' = k3*x2 - k4*x3", "x4' = k4*x3 - k5*x4"]
LATE = {"h": mf.Free(0.5, min=0, max=1)}
FULL = [[f"a{i}{j}" for j in range(4)] for i in range(4)]


def made(script: Path) -> mf.Equation:
    """The equation of a script of the gallery."""
    names: dict[str, Any] = {"mf": mf}
    code = gallery.equation(script.read_text(encoding="utf-8"))
    exec(code, names)
    model: mf.Equation = names[code.split()[0]]
    return model


MODELS: dict[str, Callable[[], Any]] = {
    **{script.stem: partial(made, script) for script in gallery.SCRIPTS},
    "Mackey-Glass": lambda: mf.Equation("y' = b*y(t - h)/(1 + y(t - h)**10) - a*y", params=LATE),
    "FitzHugh-Nagumo, v only": lambda: mf.Equation(FITZHUGH, outputs=["v"]),
    "hidden flow": lambda: mf.Equation(FLOW, outputs=["alpha", "q"], inputs=["de"]),
    "Lorenz without w": lambda: mf.Equation(LORENZ, outputs=["x", "z"]),
    "tanks, second only": lambda: mf.Equation(TANKS, outputs=["h2"]),
    "four compartments": lambda: mf.Equation(CHAIN, outputs=["x4"]),
    "products": lambda: mf.Equation("y*y'' + a*y'**2 + b*y = u"),
    "short period": lambda: mf.StateSpace([["Za", 1], ["Ma", "Mq"]], ["Zd", "Md"], states=["alpha", "q"]),
    "short period, q only": lambda: mf.StateSpace([["Za", 1], ["Ma", "Mq"]], ["Zd", "Md"], [0, 1]),
    "4 states of 20 names": lambda: mf.StateSpace(FULL, ["b0", "b1", "b2", "b3"], [1, 0, 0, 0]),
}


def main() -> int:
    print(f"load {os.getloadavg()[0]:.1f}, SymPy {sympy.__version__}; s, each from an empty cache\n")
    slow = 0
    for name, make in MODELS.items():
        sympy.core.cache.clear_cache()
        start = time.process_time()
        model = make()
        terms = len(model.compiled().terms)
        took = time.process_time() - start
        start = time.process_time()
        model.identifiable()
        asked = time.process_time() - start
        slow += took > MOST
        print(f"{name:<28}{terms:>4} terms{took:>8.3f}   identifiable{asked:>8.3f}")
    print(f"\n{slow} of {len(MODELS)} take more than {MOST} s")
    return int(slow > 0)


if __name__ == "__main__":
    sys.exit(main())
