"""Logistic growth: a fish stock under fishing.

y is the stock in kilotonnes, r its rate of growth per year, K the stock that the sea can feed, and u the
effort of the fleet, which catches `q*y*u`. The coefficient of `y**2` is r/K. The effort keeps changing, which
allows all three to be estimated.
"""

import modfun as mf

stock = mf.Equation("y' = r*y*(1 - y/K) - q*y*u", params={"K": mf.Free(100.0, min=1.0)})
truth = {"r": 0.9, "K": 120.0, "q": 0.5}
rec = mf.simulate(
    stock.model(truth),
    input="0.8 + 0.6*sin(t**2/25) + 0.2*sin(0.7*t)",
    duration=30.0,
    intervals=600,
    initial_state=[20.0],
    nsr=0.05,
    seed=1,
)
fit = mf.fit(rec, stock)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
