"""Every kind of fit has its page; what it has not, the page says in words."""

import re
import warnings

import modfun as mf
import numpy as np
import pytest

T = np.arange(401) * 0.05
U = np.sin(T**2 / 8)


def noisy(system, sigma=0.02):
    y = system.simulate(u=U, dt=0.05)
    return y + sigma * np.random.default_rng(0).normal(size=y.shape)


def of_equation():
    m = mf.Equation("y'' + d*y' + a*y + b*y**3 = u")
    y = noisy(m.model({"d": 0.4, "a": 2.0, "b": 1.5}), 0.002)
    return mf.fit(mf.Record(y=y, u=U, dt=0.05, mask=np.abs(T - 7) > 0.3), m)


def of_state_space():
    m = mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"])
    y = noisy(m.model({"Za": -1.0, "Ma": -6.0, "Mq": -1.5, "Zd": -0.1, "Md": -8.0}))
    names = {"outputs": ["alpha", "q"], "inputs": ["de"], "dt": 0.05}
    return mf.fit(
        [mf.Record(y=y[:, :250], u=U[:250], **names), mf.Record(y=y[:, 150:], u=U[150:], **names)], m
    )


def of_gains():
    omega = np.linspace(0.3, 9, 40)
    gains = mf.tf([2, 5], [1, 3, 8]).frequency_response(omega).response
    gains = gains + 0.01 * np.random.default_rng(0).normal(size=gains.shape)
    return mf.fit(
        mf.FrequencyResponse(omega, gains, bse=np.full(gains.shape, 0.01)), mf.TransferFunction(poles=2)
    )


def of_delay():
    late = mf.TransferFunction(poles=1, zeros=0, delay=mf.Free(0.1, min=0, max=0.5))
    return mf.fit(mf.Record(y=noisy(mf.tf([3], [1, 2], delay=0.2)), u=U, dt=0.05), late)


def free_and_unstable():
    y = np.exp(0.2 * T) * np.cos(3 * T) + 0.1 * np.random.default_rng(0).normal(size=T.size)
    return mf.fit(mf.Record(y=y, dt=0.05), mf.TransferFunction(poles=2))


def without_samples():
    return mf.fit(
        mf.Record(y=noisy(mf.tf([3], [1, 2])), u=U, dt=0.05), mf.TransferFunction(poles=1)
    ).without_samples()


KINDS = {
    of_equation: (
        "Equation of y from u", ["<msup><mrow><mi>y</mi></mrow>", "samples masked", "not asked for poles"], 2,
    ),
    of_state_space: ("State space of alpha, q from de", ["<mtable>", "Md", "record 1", "equation 2"], 0),
    of_gains: ("Transfer function of y from u", ["frequency response, 40 frequencies", "mf.fit(frf, "], 0),
    of_delay: ("Transfer function of y from u", ["<mi>e</mi>", "delay"], 0),
    free_and_unstable: ("Transfer function of y, free motion", ["unstable", "a free motion has no input"], 1),
    without_samples: ("Transfer function of y from u", ["the samples are not kept"], 4),
}  # fmt: skip


@pytest.mark.parametrize("make", KINDS, ids=lambda make: make.__name__)
def test_page_of(make, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)
        fit = make()
    text = fit.report(tmp_path / "fit.html").read_text(encoding="utf-8")
    title, words, left_out = KINDS[make]
    assert f"<h1>{title}</h1>" in text
    for said in words:
        assert said in text
    assert len(re.findall("<p>Left out: ", text)) == left_out
    for cell in repr(fit.table()).split("\n")[1].split():
        assert f">{cell}</td>" in text
    assert len(text) < 1.5e6


def test_a_fit_without_numbers_has_a_page_that_says_so(tmp_path):
    both = mf.Record(y=noisy(mf.tf([3], [1, 2])), u=[U, 2 * U], dt=0.05)
    with pytest.warns(mf.ModfunWarning, match="cannot tell"):
        fit = mf.fit(both, mf.TransferFunction(poles=2))
    assert fit.status == "rank"
    text = fit.report(tmp_path / "fit.html").read_text(encoding="utf-8")
    assert "There is no usable estimate" in text
    assert fit.message.split(":")[0] in text
    assert 'id="spectrum"' in text
    assert 'id="model"' not in text


def test_a_defect_is_not_turned_into_words(tmp_path, monkeypatch, undrawn):
    fit = of_delay()
    for error in (ZeroDivisionError("a defect"), mf.InternalError("a defect")):
        with monkeypatch.context() as patched:
            patched.setattr(mf.Fit, "pole_gradients", lambda *_, error=error: (_ for _ in ()).throw(error))
            with pytest.raises(type(error), match="a defect"):
                fit.report(tmp_path / "fit.html")
    assert not (tmp_path / "fit.html").exists()


def test_command_line(tmp_path, monkeypatch, capsys, undrawn):
    from modfun.commands.main import main

    monkeypatch.chdir(tmp_path)
    mf.Record(y=noisy(mf.tf([3], [1, 2])), u=U, dt=0.05).to_csv("run.csv")
    words = ["--time", "t", "--output", "y", "--input", "u", "--poles", "1", "--harmonics", "9"]
    assert main(["fit", str(tmp_path / "run.csv"), *words, "--report", "fit.html"]) == 0
    text = (tmp_path / "fit.html").read_text(encoding="utf-8")
    assert (
        "modfun fit --output y --input u --time t --poles 1 --harmonics 9 --report fit.html run.csv" in text
    )
    assert str(tmp_path) not in text
    assert "modfun: wrote fit.html" in capsys.readouterr().err
    assert main(["fit", "run.csv", *words, "--report", "fit.txt"]) == 2
    assert "end it in .html" in capsys.readouterr().err
