"""Levels of noise that drives the system, in batches: those of single fits, in fields, table and frame."""

from typing import Any

import modfun as mf
import numpy as np
import pytest

SHAPES: dict[str, tuple[Any, Any, dict[str, Any]]] = {
    "one output": (mf.TransferFunction(poles=2, zeros=0), mf.tf([5], [1, 3, 8]), {"process_noise": 0.8}),
    "equations": (
        mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"]),
        {"Za": -1.2, "Ma": -4.0, "Mq": -1.6, "Zd": -0.1, "Md": -6.0},
        {"process_noise": [0.1, 0.2]},
    ),
}


def records(kind: str, count: int = 4) -> tuple[Any, list[mf.Record]]:
    structure, system, words = SHAPES[kind]
    system = structure.model(system) if isinstance(system, dict) else system
    made = [
        mf.simulate(system, input="sin(t**2/5)", duration=12.0, intervals=300, nsr=0.03, seed=seed, **words)
        for seed in range(count)
    ]
    return structure, made  # type: ignore[return-value]


@pytest.mark.parametrize("kind", SHAPES)
def test_levels_of_a_batch_are_those_of_single_fits(kind: str) -> None:
    structure, made = records(kind)
    many = mf.fit_many(made, structure, noise="process")
    assert many.levels is not None
    for k, rec in enumerate(made):
        alone = mf.fit(rec, structure, noise="process", band=many.band).process_noise()
        np.testing.assert_allclose(many.levels[0][k], alone["level"], rtol=1e-5, atol=1e-12)
        np.testing.assert_allclose(many.levels[1][k], alone["se"], rtol=1e-4)
        assert many.level_names == tuple(
            f"{noise} of {of}" for noise, of in zip(alone["noise"], alone["of"], strict=True)
        )
    table = many.process_noise()
    np.testing.assert_allclose(table["mean"], many.levels[0].mean(axis=0))
    np.testing.assert_allclose(table["sd"], many.levels[0].std(axis=0, ddof=1))
    np.testing.assert_allclose(table["mean_se"], np.nanmean(many.levels[1], axis=0))
    assert many.to_pandas()[many.level_names[-1]].tolist() == many.levels[0][:, -1].tolist()
    one_by_one = mf.fit_many([*made, made[0].window(0.0, 10.0)], structure, noise="process")
    assert one_by_one.levels is not None
    np.testing.assert_allclose(one_by_one.levels[0][:4], many.levels[0], rtol=1e-5, atol=1e-12)


def test_a_record_without_an_estimate_has_no_levels() -> None:
    structure, made = records("one output")
    y = np.array([rec.y for rec in made])
    y[1, 0, 5] = np.nan
    batch = mf.Batch(y, made[0].u, made[0].dt)
    many = mf.fit_many(batch, structure, noise="process")
    assert many.levels is not None
    assert np.isnan(many.levels[0][1]).all()
    assert np.isfinite(many.levels[0][[0, 2, 3]]).all()
    assert np.isfinite(many.process_noise()["mean"]).all()


def test_without_such_noise_there_are_no_levels() -> None:
    structure, made = records("one output", 2)
    many = mf.fit_many(made, structure)
    assert (many.levels, many.level_names) == (None, ())
    with pytest.raises(mf.ModfunError, match='all noise is that of the samples; fit with noise="process"'):
        many.process_noise()
