"""Loops under slow disturbances, and those that only regulate: named, with advice that helps."""

from __future__ import annotations

import warnings

import modfun as mf
import numpy as np
import pytest
from modfun.results.innovations import innovations
from scipy.signal import cont2discrete, lfilter, tf2ss

# Numerator, denominator, gains of the error and of its integral, step, zeros
PLANTS = {
    "first": ([2.0], [5.0, 1.0], (1.5, 0.4), 0.2, 0),
    "second": ([2.0], [2.0, 3.0, 1.0], (1.0, 0.35), 0.1, 0),
    "lead": ([4.0, 1.0], [1.0, 1.2, 1.0], (0.4, 0.5), 0.1, 1),
}
COUNT = 1500


def coloured(pole: float, rng: np.random.Generator) -> np.ndarray:
    return lfilter([np.sqrt(1 - pole**2)], [1, -pole], rng.standard_normal(COUNT + 500))[500:]


def steps(held: int, rng: np.random.Generator) -> np.ndarray:
    return np.repeat(rng.choice([-1.0, 0.0, 1.0, 2.0], COUNT // held + 1), held)[:COUNT]


def plant(which: str) -> tuple[mf.TransferFunction, np.ndarray]:
    """The model of a plant, and its parameters."""
    num, den, _, _, zeros = PLANTS[which]
    model = mf.TransferFunction(poles=len(den) - 1, zeros=zeros)
    return model, np.array([*den[1:], *num]) / den[0]


def closed(which: str, seed: int, pole: float = 0.95, moves: float = 1.0, dither: float = 0.0) -> mf.Record:
    """A loop closed by a computer, its disturbance 0.3; the command or the dither is kept."""
    num, den, (gain, integral), dt, _ = PLANTS[which]
    a, b, c, _ = tf2ss(num, den)
    step, kick = cont2discrete((a, b, c, np.zeros((1, 1))), dt)[:2]
    rng = np.random.default_rng(seed)
    v, r, added = 0.3 * coloured(pole, rng), moves * steps(60, rng), dither * steps(15, rng)
    x, y, u, total = np.zeros(len(a)), np.zeros(COUNT), np.zeros(COUNT), 0.0
    for k in range(COUNT):
        y[k] = (c @ x)[0] + v[k]
        u[k] = gain * (r[k] - y[k]) + total + added[k]
        total += integral * dt * (r[k] - y[k])
        x = step @ x + kick[:, 0] * u[k]
    kept = {"dither": added} if dither else {"command": r} if moves else None
    return mf.Record(y=y, u=u, dt=dt, intersample="zoh", keep=kept)


def fitted(rec: mf.Record, model: mf.TransferFunction, **words: object) -> tuple[mf.Fit, str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fit = mf.fit(rec, model, **words)  # type: ignore[arg-type]
    return fit, "; ".join(str(one.message) for one in caught)


@pytest.mark.parametrize("pole", [0.9, 0.95])
@pytest.mark.parametrize("which", PLANTS)
def test_a_loop_is_named_under_a_slow_disturbance(which: str, pole: float) -> None:
    """Of 240 others of six plants 237 warned and `check` named all; before, none. The advice is right."""
    model, truth = plant(which)
    rec = closed(which, 0, pole)
    text = fitted(rec, model)[1]
    assert "u follows earlier residuals of y" in text
    assert 'reference="command"' in text
    fit, text = fitted(rec, model, reference="command", initial_state="unknown")
    assert text == ""
    assert np.all(np.abs(fit.params - truth) < 4 * fit.bse)


@pytest.mark.parametrize("which", PLANTS)
def test_a_record_of_regulation_is_told_from_one_of_a_plant(which: str) -> None:
    """Estimates are minus the inverse of the controller: of 192 others all warned so."""
    model, truth = plant(which)
    for seed in range(2):
        fit, text = fitted(closed(which, seed, moves=0.0), model)
        assert np.max(np.abs(fit.params - truth) / np.abs(truth)) > 1
        assert "u does nothing but answer y" in text
        assert "a dither is added to the input" in text
        assert 'Record(keep={"r": ...})' in text
        assert any(said.startswith("u does nothing but") for said in fit.check())


def test_a_kept_command_that_stands_still_is_no_reference() -> None:
    rec = closed("second", 0, moves=0.0)
    still = mf.Record(y=rec.y, u=rec.u, dt=rec.dt, intersample="zoh", keep={"r": np.zeros(COUNT)})
    text = fitted(still, plant("second")[0])[1]
    assert "First make a record in which the command moves" in text
    assert 'and fit with reference="r"' in text


@pytest.mark.parametrize("which", PLANTS)
def test_a_dither_tells_the_plant_of_a_loop_that_regulates(which: str) -> None:
    model, truth = plant(which)
    fit, text = fitted(
        closed(which, 0, moves=0.0, dither=1.0), model, reference="dither", initial_state="unknown"
    )
    assert text == ""
    assert np.all(np.abs(fit.params - truth) < 4 * fit.bse)


def opened(kind: str, seed: int, pole: float, share: float) -> mf.Record:
    """The plant 5/(s² + 1.5 s + 8) in an open loop, or one of four poles, under the same disturbance."""
    rng = np.random.default_rng(seed)
    den = np.array([1.0, 1.5, 8.0])
    if kind == "four poles":
        den = np.polymul(den, np.polymul([1, 6], [1, 4])) / 24
    u = coloured(0.9, rng) if kind in ("four poles", "coloured", "late", "two") else steps(5, rng)
    late = 15 if kind == "a delay" else 0
    y = np.roll(mf.tf([5.0], den).simulate(u=u, dt=0.1, intersample="zoh"), late)
    y[:late] = 0.0
    inputs = [u]
    if kind == "two":
        inputs.append(steps(8, rng))
        y = y + mf.tf([5.0], [1.0, 2.0]).simulate(u=inputs[1], dt=0.1, intersample="zoh")
    y = y + share * coloured(pole, rng)
    if kind == "late":  # the input is read a sample late
        return mf.Record(y=y[1:], u=u[:-1], dt=0.1, intersample="zoh")
    return mf.Record(y=y, u=np.array(inputs), dt=0.1, intersample="zoh")


@pytest.mark.parametrize("share", [0.02, 0.3])
@pytest.mark.parametrize("kind", ["coloured", "steps", "four poles", "a delay", "two", "late"])
def test_records_of_no_loop_are_not_named(kind: str, share: float) -> None:
    """Nor are models that lack poles or a delay, of which residuals are far above the noise."""
    for seed in range(3):
        fit, text = fitted(opened(kind, seed, 0.95, share), mf.TransferFunction(poles=2, zeros=0))
        assert not any("earlier residuals" in one or "does nothing" in one for one in (text, *fit.check()))


def test_smooth_inputs_tell_what_comes() -> None:
    """Between its samples an input follows later ones, too, which innovations show at little noise."""
    rng = np.random.default_rng(5)
    fine = np.fft.irfft(np.fft.rfft(lfilter([0.2], [1, -0.8], rng.standard_normal(2000))), 16000) * 8
    y = mf.tf([5.0], [1.0, 1.5, 8.0]).simulate(u=fine, dt=0.01, intersample="foh")[::8]
    y = y + 0.003 * y.std() * lfilter([0.3], [1, -0.95], rng.standard_normal(2000))
    rec = mf.Record(y=y, u=fine[::8], dt=0.08, intersample="smooth")
    assert "earlier residuals" not in fitted(rec, mf.TransferFunction(poles=2, zeros=0))[1]


def test_innovations_tell_noise_and_gain_in_a_loop() -> None:
    """Gain and power of an AR(1) disturbance, where a fit of the response is biased."""
    rec = closed("first", 3)
    found = innovations(rec.y, rec.u, 6, 6, [1])
    turn = np.array([0.1, 0.3, 1.0])
    decay = np.exp(-0.2 / 5)
    z = np.exp(1j * turn)
    np.testing.assert_allclose(found.gain(turn)[0, 0], 2 * (1 - decay) / (z - decay), rtol=0.3)
    noise = 0.09 * (1 - 0.95**2) / np.abs(1 - 0.95 / z) ** 2
    np.testing.assert_allclose(found.power(turn)[0], noise, rtol=0.3)
