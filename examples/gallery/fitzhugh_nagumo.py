"""FitzHugh-Nagumo: a nerve that fires.

v is the voltage of the nerve and w its recovery. Fast and slow motion alternate in relaxation oscillations.
Both signals are measured.
"""

import modfun as mf

nerve = mf.Equation(
    ["v' = c*(v - v**3/3 + w)", "w' = -(v - a + b*w)/c"],
    outputs=["v", "w"],
    params={"c": mf.Free(2.0, min=0.1)},
)
truth = {"c": 3.0, "a": 0.2, "b": 0.2}
rec = mf.simulate(
    nerve.model(truth),
    duration=20.0,
    intervals=800,
    initial_state=[-1.0, 1.0],
    nsr=0.05,
    seed=1,
)
fit = mf.fit(rec, nerve)

for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True):
    print(f"{name} = {value:.4g} ± {error:.2g}   (true {truth[name]:g})")
