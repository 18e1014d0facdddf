"""Michaelis-Menten: an enzyme uses up its substrate s, fast while there is plenty, slower when it gets rare.

s' = -V*s/(K + s), multiplied out: (K + s)*s' + V*s = 0, in which s*s' is (s**2)'/2. One progress curve tells
both constants.
"""

import modfun as mf

enzyme = mf.Equation("(K + s)*s' + V*s = 0", outputs=["s"])
truth = {"K": 1.5, "V": 1.0}
rec = mf.simulate(enzyme.model(truth), duration=12.0, intervals=480, initial_state=[5.0], nsr=0.01, seed=1)
fit = mf.fit(rec, enzyme)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
