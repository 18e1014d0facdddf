"""Many fits of noisy records of one noise-free response: bias, spread, coverage, as rows of tables."""

import warnings

import modfun as mf
import numpy as np
from scipy.integrate import solve_ivp
from scipy.stats import t as student

HEAD = "lines | rms bias, % | rms sd, % | HC3 covers, % | classical covers, % | failures |"


def response(rhs, x0, period, intervals):
    """States (n, N+1) at equal steps, to ten digits."""
    t = np.linspace(0, period, intervals + 1)
    return solve_ivp(rhs, (0, period), x0, t_eval=t, rtol=1e-10, atol=1e-12, method="DOP853").y


def table(first, head=HEAD):
    """Prints the head of a table."""
    columns = f"| {first} | {head}"
    print(columns)
    print("|" + "---|" * (columns.count("|") - 1), flush=True)


class Study:
    """Single fits, each as a user gets it, of `replicates` noisy records.

    `clean` (channel, N+1); `sigma` one a channel or, with `log`, the standard deviation of the logarithms;
    `names` of outputs and inputs; further options are those of `mf.fit`.
    """

    def __init__(
        self, model, truth, clean, dt, sigma, names, replicates, u=None, log=False, seed=1, **options
    ):
        self.names, self.dt, self.log = names, dt, log
        self.clean = np.atleast_2d(clean)
        self.u = u
        self.sigma = np.broadcast_to(np.asarray(sigma, float), len(self.clean))
        rng = np.random.default_rng(seed)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mf.ModfunWarning)
            fits = [mf.fit(self.record(rng), model, **options) for _ in range(replicates)]
        good = [f for f in fits if f.success]
        self.failures = len(fits) - len(good)
        self.param_names = good[0].param_names
        self.truth = np.array([truth[name] for name in self.param_names])
        self.params = np.array([f.params for f in good])
        self.harmonics = np.median([f.lines[0][1] for f in good])
        self.inside = [
            np.mean([self.holds(f, f.cov_hc3, f.df_hc3) for f in good], axis=0),
            np.mean([self.holds(f, f.cov_nonrobust, f.df_resid) for f in good], axis=0),
        ]

    def record(self, rng):
        """The next record."""
        noise = self.sigma[:, None] * rng.standard_normal(self.clean.shape)
        y = self.clean * np.exp(noise) if self.log else self.clean + noise
        outputs, inputs = self.names
        return mf.Record(y=y, u=self.u, dt=self.dt, outputs=outputs, inputs=inputs)

    def holds(self, fit, cov, degrees):
        """Whether the 95 % interval of each parameter holds the truth."""
        half = student.ppf(0.975, degrees) * np.sqrt(np.diag(cov))
        return np.abs(fit.params - self.truth) <= half

    def relative(self):
        """(bias, its Monte Carlo error, sd), rms over the parameters, % of the true values."""
        params = self.params / self.truth
        bias, sd = params.mean(axis=0) - 1, params.std(axis=0, ddof=1)
        size, each = np.sqrt(np.mean(bias**2)), np.sqrt(np.mean(sd**2))
        return 100 * size, 100 * each / np.sqrt(len(params)), 100 * each

    def covers(self):
        """Coverage of HC3 and of classical intervals: mean over the parameters, least and most, %."""
        return " | ".join(
            f"{100 * np.mean(c):.1f} ({100 * np.min(c):.1f}–{100 * np.max(c):.1f})" for c in self.inside
        )

    def cells(self):
        """What the columns of HEAD hold."""
        bias, error, sd = self.relative()
        return (
            f"{self.harmonics:.0f} | {bias:.2f} ± {error:.2f} | {sd:.2f} | {self.covers()} | {self.failures}"
        )
