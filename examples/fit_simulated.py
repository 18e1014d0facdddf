"""Fit a simulated record, and compare what was found with the truth and with the Cramér-Rao bound.

python examples/fit_simulated.py
"""

import modfun as mf
import numpy as np


def main() -> mf.Fit:
    """Simulate, fit, compare."""
    system = mf.tf([5], [1, 3, 8])  # y'' + 3 y' + 8 y = 5 u
    truth = {"a1": 3.0, "a2": 8.0, "b0": 5.0}
    rec = mf.simulate(
        system,
        input="sin(t**2/5)",
        duration=10.0,
        intervals=1024,
        nsr=0.1,  # noise standard deviation over the rms of the response
        initial_state=[1.0, 0.5],  # the fit neither knows nor needs it
        seed=0,
    )
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    bound = mf.crlb(system, rec, nsr=0.1)

    print(fit.summary())
    print()
    print("No unbiased estimator does better than this on such records, on average:")
    print(bound)
    print()
    off = {name: (fit[name] - truth[name]) / se for name, se in zip(fit.param_names, fit.bse, strict=True)}
    print("Errors in standard errors:", ", ".join(f"{name} {value:+.1f}" for name, value in off.items()))

    # The initial state is found afterwards, from the record and the model.
    print("Initial state:", np.round(fit.initial_state(rec), 2), "(truth: 1, 0.5)")
    return fit


if __name__ == "__main__":
    main()
