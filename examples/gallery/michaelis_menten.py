"""Michaelis-Menten: an enzyme in a fed reactor.

The enzyme uses up the substrate, more slowly the rarer it becomes. s is the concentration of the substrate
and u its feed, in concentration per hour. `s' = u - V*s/(K + s)` is multiplied out:
`(K + s)*(s' - u) + V*s = 0`, in which `s*s'` is `(s**2)'/2`.
"""

import modfun as mf

enzyme = mf.Equation("(K + s)*(s' - u) + V*s = 0", outputs=["s"])
truth = {"K": 1.5, "V": 2.0}
rec = mf.simulate(
    enzyme.model(truth),
    input="0.9 + 0.8*sin(t**2/20)",
    duration=24.0,
    intervals=720,
    initial_state=[3.0],
    nsr=0.03,
    seed=1,
)
fit = mf.fit(rec, enzyme)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
