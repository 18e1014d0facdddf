"""Several delays of a distillation column: each output alone tells where they start."""

import modfun as mf
import numpy as np
import pytest

# Gain, time constant and delay (min) of each path: R. K. Wood and M. W. Berry, Chem. Eng. Sci. 28, 1973.
COLUMN = {
    "top": {"reflux": (12.8, 16.7, 1), "steam": (-18.9, 21.0, 3)},
    "bottom": {"reflux": (6.6, 10.9, 7), "steam": (-19.4, 14.4, 3)},
}
NOISE = 0.1
SAMPLES = 501


def record(seed):
    """Random steps of both inputs, exact responses, and noise."""
    rng = np.random.default_rng(seed)
    u = {name: np.repeat(rng.choice([-1.0, 1.0], 51), 10)[:SAMPLES] for name in ("reflux", "steam")}
    y = {output: NOISE * rng.standard_normal(SAMPLES) for output in COLUMN}
    for output, paths in COLUMN.items():
        for name, (gain, constant, late) in paths.items():
            pole = np.exp(-1 / constant)
            x = np.zeros(SAMPLES)
            for k in range(SAMPLES - 1):
                x[k + 1] = pole * x[k] + gain * (1 - pole) * (u[name][k - late] if k >= late else 0.0)
            y[output] += x
    return mf.Record(y=y, u=u, dt=1.0, intersample="zoh")


def late():
    return mf.Free(min=0.0, max=10.0)


@pytest.mark.parametrize("seed", [3, 6, 7])
def test_four_delays_end_in_the_right_minimum(seed):
    """Seeds 3 and 6 ended at 7.8 and 0.5 min for 7 and 3, with "ok", when all were sought together."""
    structure = mf.TransferFunction(
        poles=[2, 2],
        zeros=[[1, 1], [1, 1]],
        denominator="separate",
        delay=[[late(), late()] for _ in range(2)],
    )
    fit = mf.fit(record(seed), structure)
    assert fit.status == "ok"
    for output, paths in COLUMN.items():
        for name, (_, _, delay) in paths.items():
            found = fit.params[f"delay[{output},{name}]"]
            # 5 standard errors for 12 delays: false alarm below 1e-5.
            assert abs(found - delay) < 5 * fit.bse[f"delay[{output},{name}]"] < 0.3


def test_held_and_bounded_parameters_keep_their_places():
    """A held coefficient, a bound and a known delay beside three free ones: all numbers stay in place."""
    rec = record(0)
    pole = 1 / 10.9 + 1 / 14.4
    structure = mf.TransferFunction(
        poles=[2, 2],
        zeros=[[1, 1], [1, 1]],
        denominator="separate",
        delay=[[1.0, late()], [late(), late()]],
        params={"a1[bottom]": pole, "b0[top,reflux]": mf.Free(min=0.0, max=0.9)},
    )
    fit = mf.fit(rec, structure)
    assert fit.params.names == (
        "a1[top]", "a2[top]", "b0[top,reflux]", "b1[top,reflux]", "b0[top,steam]", "b1[top,steam]",
        "a2[bottom]", "b0[bottom,reflux]", "b1[bottom,reflux]", "b0[bottom,steam]", "b1[bottom,steam]",
        "delay[top,steam]", "delay[bottom,reflux]", "delay[bottom,steam]",
    )  # fmt: skip
    assert fit.params["b0[top,reflux]"] == pytest.approx(12.8 / 16.7, rel=0.05)
    assert fit.params["a2[bottom]"] == pytest.approx(1 / (10.9 * 14.4), rel=0.1)
    assert fit.params[-3:] == pytest.approx([3.0, 7.0, 3.0], abs=0.1)


def test_batches_start_where_single_fits_do():
    records = [record(seed) for seed in (3, 6)]
    structure = mf.TransferFunction(
        poles=[2, 2], zeros=1, denominator="separate", delay=[[1.0, 3.0], [late(), late()]]
    )
    several = mf.fit_many(records, structure, method="awls", band=(0, 0.4))
    for k, rec in enumerate(records):
        one = mf.fit(rec, structure, method="awls", band=(0, 0.4))
        assert np.abs(several.params[k] - one.params).max() < 0.01 * one.bse.min()
