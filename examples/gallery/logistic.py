"""Logistic growth: yeast in a closed vessel, from a spoonful to as much as the sugar feeds.

y is the biomass, r the rate of growth, K what the vessel carries. The coefficient of y**2 is r/K.
"""

import modfun as mf

yeast = mf.Equation("y' = r*y*(1 - y/K)", params={"K": mf.Free(10.0, min=0.1)})
truth = {"r": 0.9, "K": 6.0}
rec = mf.simulate(yeast.model(truth), duration=12.0, intervals=240, initial_state=[0.2], nsr=0.05, seed=1)
fit = mf.fit(rec, yeast)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
