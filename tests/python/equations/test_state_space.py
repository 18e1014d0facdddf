"""StateSpace: state equations where states are measured, input/output form where they are not."""

import pickle

import modfun as mf
import numpy as np
import pytest

sympy = pytest.importorskip("sympy")

from equation_identities import vanishes  # noqa: E402


def short_period(**words):
    return mf.StateSpace(
        [["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"], **words
    )


def motion(model):
    """States' rates and outputs from the matrices, for `vanishes`."""

    def value(entry, p):
        return sympy.sympify(entry, locals=vars(p)) if isinstance(entry, str) else entry

    def rows(matrices, vectors, p):
        sums = []
        for rows_of in zip(*matrices, strict=True):
            pairs = [
                (e, v)
                for row, vector in zip(rows_of, vectors, strict=True)
                for e, v in zip(row, vector, strict=True)
            ]
            sums.append(sum((value(e, p) * v for e, v in pairs), sympy.S.Zero))
        return sums

    def made(x, u, p):
        vectors = [[getattr(x, n) for n in model.states], [getattr(u, n) for n in model.inputs]]
        rates = dict(zip(model.states, rows((model.A, model.B), vectors, p), strict=True))
        return rates, dict(zip(model.outputs, rows((model.C, model.D), vectors, p), strict=True))

    return made


THREE = [["a", 1, "c"], ["k*e1", "b", 2], ["f", "g", "h**2"]]
MODELS = {
    "short period": short_period(),
    "alpha only": short_period().without("q"),
    "q only": short_period().without("alpha"),
    "acceleration": short_period(C=[["V*Za", 0]], D=[["V*Zd"]], outputs=["az"]),
    "acceleration and rate": short_period(C=[["V*Za", 0], [0, 1]], D=[["V*Zd"], [0]], outputs=["az", "q"]),
    "transformed": short_period(C=[[1, 1], [0, 2]], D=[["d"], [0]], outputs=["v", "w"]),
    "two of three": mf.StateSpace(THREE, ["k", "l", "m"], [[1, 0, 0], [0, 1, 0]]),
    "one of three": mf.StateSpace(THREE, ["k", "l", "m"], [0, 0, 1]),
    "two inputs": mf.StateSpace(THREE, [["k", 0], [0, "l"], [1, 1]], [1, 0, 0], [["d", 0]]),
    "free motion": mf.StateSpace([[0, 1], ["-k", "-d"]], C=[1, 0]),
    "unseen state": mf.StateSpace([["a", 1, 0], [0, "b", 0], [1, 0, 0]], [0, 1, 0], [1, 0, 0]),
}


@pytest.mark.parametrize("name", MODELS)
def test_terms_vanish_along_the_motion(name):
    vanishes(MODELS[name], MODELS[name].states, motion(MODELS[name]))


def test_measured_states_are_fitted_as_they_stand():
    compiled = MODELS["short period"].compiled()
    assert compiled.orders == (1, 1)
    assert compiled.hidden == ()
    assert compiled.parameters == ("Za", "Ma", "Mq", "Zd", "Md")
    assert [str(term.coefficient) for term in compiled.terms] == [
        "1",
        "-Za",
        "-1",
        "-Zd",
        "1",
        "-Ma",
        "-Mq",
        "-Md",
    ]


def test_one_output_has_the_characteristic_polynomial():
    compiled = MODELS["q only"].compiled()
    values = {"Za": -1.5, "Ma": -4.0, "Mq": -2.0, "Zd": -0.2, "Md": -6.0}
    numbers = {sympy.Symbol(n, real=True): v for n, v in values.items()}
    system = short_period().model([values[n] for n in short_period().param_names()])
    num, den = system.polynomials()
    for signal, sign, wanted in (("q", 1, den[1][0]), ("de", -1, num[1][0])):
        terms = {
            t.order: float(t.coefficient.subs(numbers)) for t in compiled.terms if str(t.signal) == signal
        }
        found = [sign * terms.get(k, 0.0) for k in range(2, -1, -1)]
        np.testing.assert_allclose(
            found, np.concatenate([np.zeros(3 - len(wanted)), wanted]), rtol=1e-12, atol=1e-12
        )


def test_orders_are_no_higher_than_it_takes():
    assert MODELS["two of three"].compiled().orders == (1, 2)
    assert MODELS["unseen state"].compiled().orders == (2,)
    assert "order 2 is left" in str(MODELS["unseen state"].explain())


def test_identifiability_of_the_short_period():
    """The report's finding: without the noisy signal only some parameters can be found."""
    both, alone = MODELS["short period"].identifiable(), MODELS["q only"].identifiable()
    assert both
    assert (both.rank, both.lost) == (5, ())
    assert not alone
    assert alone.rank == 4
    assert alone.found == ("Md",)
    assert "only 3 combination(s) of these 4" in str(alone)
    assert "<li>" in alone._repr_html_()


@pytest.mark.parametrize(
    ("text", "rank", "lost", "words"),
    [
        ("M*y'' + d*y' + k*y = u", 3, (), "All 3 parameters"),
        (
            "M*y'' + d*y' + k*y = b*u",
            3,
            ("M", "d", "k", "b"),
            "multiplying M by s, d by s, k by s and b by s",
        ),
        ("y'' + a*b*y' + k*y = u", 2, ("a", "b"), "multiplying a by s and b by s**(-1)"),
        ("y'' + (a + b)*y' + k*y = u", 2, ("a", "b"), "adding s to a and -1*s to b"),
        ("y'' + sin(a*b)*y' + k*y = u", 2, ("a", "b"), "multiplying a by s and b by s**(-1)"),
        ("y' + sin(k*y) = u", 1, (), "All 1 parameters"),
        (["x' = a*x - b*x*z", "z' = -c*z + d*x*z + 0*y", "y = x"], 3, ("b",), "b: in no term"),
    ],
)
def test_identifiability_in_words(text, rank, lost, words):
    found = mf.Equation(text, outputs=["y"]).identifiable()
    assert (found.rank, found.lost) == (rank, lost)
    assert words in str(found)
    assert bool(found) == (not lost)


def test_numbers_make_a_system():
    m = short_period(params={"Zd": -0.2})
    assert m.param_names() == ("Za", "Ma", "Mq", "Md")
    system = m.model([-1.5, -4.0, -2.0, -6.0])
    np.testing.assert_allclose(sorted(system.poles().imag), [-np.sqrt(4 - 0.0625), np.sqrt(4 - 0.0625)])
    named = m.model({"Md": -6.0, "Mq": -2.0, "Ma": -4.0, "Za": -1.5})
    np.testing.assert_array_equal(named.poles(), system.poles())
    with pytest.raises(mf.SpecError, match="3 numbers for 4 parameters"):
        m.model([1, 2, 3])
    with pytest.raises(mf.SpecError, match="no finite value"):
        mf.StateSpace([["1/a"]]).model([0.0])


def test_sympy_entries_are_texts():
    a, b = sympy.symbols("a b")
    m = mf.StateSpace([[sympy.sqrt(a) * b, 1], [sympy.Rational(1, 3), abs(b)]], [a / 7, 0.1])
    assert m.A == (("b*sqrt(a)", 1.0), ("1/3", "abs(b)"))
    assert m.param_names() == ("b", "a")


@pytest.mark.parametrize("name", MODELS)
def test_equal_pickled_and_stored(name):
    model = MODELS[name]
    for other in (pickle.loads(pickle.dumps(model)), mf.StateSpace.from_dict(model.to_dict())):
        assert other == model
        assert hash(other) == hash(model)
    assert eval(repr(model), {"StateSpace": mf.StateSpace, "Free": mf.Free}) == model
    assert model.explain().title[0].startswith(f"{model.states[0]}' = ")


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda: mf.StateSpace([["a", 1]]), r"A has shape \(1, 2\), with this A it is \(1, 1\)"),
        (lambda: mf.StateSpace([["a"]], [[1], [2]]), "B has shape"),
        (lambda: mf.StateSpace([["a"]], [[1]], [[1, 2]]), "C has shape"),
        (lambda: mf.StateSpace([["y'"]]), "neither a number nor a parameter"),
        (lambda: mf.StateSpace([["a(t)"]]), "neither a number nor a parameter"),
        (lambda: mf.StateSpace([["x1"]]), "'x1' stands in a matrix"),
        (lambda: mf.StateSpace([["a*t"]]), "'t' stands in a matrix"),
        (lambda: mf.StateSpace([["__import__('os')"]]), "not part of the language"),
        (lambda: mf.StateSpace([[np.inf]]), "entries are finite"),
        (lambda: mf.StateSpace([[None]]), "give a number, a name or an expression"),
        (lambda: mf.StateSpace([["a", 1], [0, "b"]], states=["x"]), "1 name"),
        (lambda: mf.StateSpace([["a"]], [[1]], states=["u"]), "named twice"),
        (
            lambda: mf.StateSpace([["a", 1], [0, 1]], C=[[1, 1]], outputs=["x1"]),
            "name of a state that it is not",
        ),
        (lambda: mf.StateSpace([["a"]], params={"b": 1.0}), "params names 'b'"),
        (lambda: mf.StateSpace(np.zeros((30, 30))), "1 to 20 states"),
        (lambda: short_period().without("alpha", "q"), "no output is left"),
        (lambda: short_period().without("de"), "'de' is not an output"),
    ],
)
def test_what_does_not_fit(make, why):
    with pytest.raises(mf.SpecError, match=why):
        make()


def test_channels_are_matched():
    with pytest.raises(mf.SpecError, match=r"StateSpace: the model has the output 'alpha'"):
        short_period().compiled(["q"], ["de"])
    assert short_period().compiled(["q", "alpha"], ["de"]).outputs == ("q", "alpha")


@pytest.mark.parametrize("seed", [4, 5, 6])
def test_filtered_records_are_weighed_by_their_own_errors(seed):
    """Slow errors, of q twenty times alpha's, over white noise of one level, all that the high band shows.

    By that level both outputs would count alike, and errors of q spoil alpha by 3, 6 and 16 dB.
    """
    truth = short_period().model({"Za": -1.5, "Ma": -8.0, "Mq": -2.5, "Zd": -0.1, "Md": -12.0})
    clean = mf.simulate(truth, input="sin(t**2/3)", duration=12.0, intervals=600, outputs=["alpha", "q"])
    rng = np.random.default_rng(seed)
    slow = [np.convolve(rng.normal(size=800), np.hanning(99), "valid")[:601] / 99**0.5 for _ in range(2)]
    y = clean.y + np.array([[0.005], [0.1]]) * slow + 1e-4 * rng.normal(size=clean.y.shape)
    rec = mf.Record(y=y, u=clean.u, dt=clean.dt, outputs=clean.outputs, inputs=["de"])
    fit = by_hand = mf.fit(rec, short_period())
    np.testing.assert_allclose(fit.seen, 1e-4, rtol=0.2)
    assert 10 < fit.levels[0, 1] / fit.levels[0, 0] < 40
    assert fit.chi2 > 100 * fit.df_resid
    for _ in range(3):
        by_hand = mf.fit(rec, short_period(), noise=mf.Noise(y=by_hand.errors().std(axis=1)), band=fit.band)
    # Levels of the lines in the band are not quite those of all samples.
    assert np.all(np.abs(fit.params - by_hand.params) < by_hand.bse)
    alike = mf.fit(rec, short_period(), noise=mf.Noise(y=1e-4), band=fit.band)
    alpha, own, spoilt = (one.score()["signal_to_error"][0] for one in (fit, by_hand, alike))
    assert abs(alpha - own) < 0.5
    assert spoilt < alpha - 2
    many = mf.fit_many([rec, rec], short_period(), band=fit.band)
    again = mf.fit(rec, short_period(), band=fit.band)
    np.testing.assert_allclose(many.params, [again.params, again.params], rtol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_levels_that_the_residuals_agree_with_stay(seed):
    """Of white noise nothing else is learnt: four standard deviations, false alarm below 1e-3 in all."""
    truth = short_period().model({"Za": -1.5, "Ma": -8.0, "Mq": -2.5, "Zd": -0.1, "Md": -12.0})
    rec = mf.simulate(
        truth, input="sin(t**2/3)", duration=12.0, intervals=600, outputs=["alpha", "q"], nsr=0.05, seed=seed
    )
    fit = mf.fit(rec, short_period())
    np.testing.assert_array_equal(fit.levels, fit.seen)


@pytest.mark.parametrize("text", ["dy/dt = -a*y", "ydot = -a*y", "y_dot + a*y = 0"])
def test_a_derivative_that_is_written_otherwise_is_refused(text):
    with pytest.raises(mf.SpecError, match="write the derivative of y as y'"):
        mf.Equation(text)


def test_a_model_reads_as_one_writes_it():
    model = mf.StateSpace(
        [["Yb", 0.08, -0.99], [-1, 1, "-k"], [-2.5, 0, 0]], [0, "b", -1], states=["v", "p", "r"], inputs=["u"]
    )
    assert str(model) == "v' = Yb*v + 0.08*p - 0.99*r; p' = -v + p + (-k)*r + b*u; r' = -2.5*v - u"
    assert str(mf.Equation([one.text for one in model.parsed], outputs=["v", "p", "r"], inputs=["u"]))
