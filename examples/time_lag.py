"""Identify, transform, control, simulate: a system whose states act on it a second later, inputs .4 s later.

x'(t) = A0 x(t) + A1 x(t - 1) + B u(t - .4), both states measured with noise; matrices of Yi, Nelson, Ulsoy.
"""

from typing import Any

import modfun as mf
import numpy as np

A0, A1, B = [[-1.0, -3.0], [2.0, -5.0]], [[1.66, -0.697], [0.93, -0.33]], [1.0, 0.0]
TRUTH = {"a11": -1.0, "a12": -3.0, "a21": 2.0, "a22": -5.0}
TRUTH |= {"c11": 1.66, "c12": -0.697, "c21": 0.93, "c22": -0.33, "b": 1.0, "h": 1.0}
POLES = [-2.5, -3.0]  # for the roots at -1.01 and -1.98


def plant() -> mf.timelag.DelaySystem:
    """The true system."""
    return mf.timelag.DelaySystem(A={0: A0, 1.0: A1}, B={0.4: B})


def record(nsr: float, seed: int = 1) -> mf.Record:
    """40 s of both states under two sweeps."""
    return mf.simulate(
        plant(),
        input="2*sin(t**2/12) + 1.5*sin((40 - t)**2/20)",
        duration=40.0,
        intervals=1000,
        nsr=nsr,
        seed=seed,
    )


def structure(lag: str | float = "h") -> mf.Equation:
    """What is fitted: the lag of the states a number, or a parameter between .2 and 2 s."""
    return mf.timelag.equation(
        A={0: [["a11", "a12"], ["a21", "a22"]], lag: [["c11", "c12"], ["c21", "c22"]]},
        B={0.4: ["b", 0]},
        params={"h": mf.Free(min=0.2, max=2.0)} if lag == "h" else None,
    )


def main() -> tuple[mf.Record, mf.Fit, mf.timelag.DelaySystem, Any, tuple[Any, Any]]:
    """Record, fit, identified plant, feedback, and the true plant without and with it."""
    rec = record(nsr=0.05)
    fit = mf.fit(rec, structure())
    identified = mf.timelag.from_fit(fit)
    design = identified.place(POLES)
    true = plant()
    start: dict[str, Any] = {"duration": 6.0, "dt": 0.02, "history": [1.0, 1.0]}
    runs = true.simulate(**start), true.simulate(design, **start)
    return rec, fit, identified, design, runs


if __name__ == "__main__":
    rec, fit, identified, design, (free, controlled) = main()
    print("parameter  estimate ± standard error   (true)")
    for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
        print(f"{name:9}  {value:8.4f} ± {error:.4f}   ({TRUTH[name]:g})")
    print(f"\n{identified.poles(6)}\n\n{design.transformation}\n")
    margin = identified.mu(design, mf.timelag.errors(fit))
    print(f"The loop bears {margin.margin:.1f} times the 95 % region of the estimates.\n")
    for word, run in (("without feedback", free), ("with u = -Kz", controlled)):
        late = np.abs(run.x[:, run.t >= 3]).max()
        print(f"The true plant {word}: largest state after 3 s {late:.4f}")
