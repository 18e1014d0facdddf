"""Study files: every key reaches its argument, and what is wrong is named with its place."""

from __future__ import annotations

import inspect
import re
import sys
from pathlib import Path
from typing import Any

import modfun as mf
import numpy as np
import pytest
import study_functions_kit as kit
from modfun.models.options import Options
from modfun.study import toml_file
from modfun.study.toml_values import line_of
from modfun.study.work import Work
from places import ROOT
from study_cases import same

TF2 = mf.TransferFunction(poles=2, zeros=0)
PLAIN = """
input = "sin(t**2/5)"
duration = 10.0
intervals = 64
nsr = 0.1
estimators = ["ls"]
harmonics = 6
system = { num = [5], den = [1, 3, 8] }
"""
ESTIMATORS = '["ls"]'


@pytest.fixture
def file(tmp_path: Path) -> Any:
    """Writes a study file and gives its path."""

    def write(text: str) -> Path:
        path = tmp_path / "study.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def key(study: mf.MonteCarlo) -> str:
    """Hash of all that the numbers of a study depend on."""
    return Work(study.plan, "samples", True, False).key


def equal(one: mf.MonteCarlo, two: mf.MonteCarlo) -> bool:
    return (
        key(one) == key(two)
        and one.replicates == two.replicates
        and one.plan.axes == two.plan.axes
        and one.estimators == two.estimators
    )


def test_each_key_is_an_argument_of_the_study() -> None:
    arguments = set(inspect.signature(mf.MonteCarlo.__init__).parameters) - {"self", "options"}
    assert set(toml_file.KEYS) == arguments | set(Options.__dataclass_fields__) - {"method"}


def test_the_example_is_the_same_study_in_python(file: Any) -> None:
    study = mf.MonteCarlo(
        system={"eq24": mf.tf([5], [1, 3, 8]), "light": mf.tf([1], [1, 0.2, 1])},
        input="sin(t**2/5)",
        duration=10.0,
        intervals=256,
        nsr=[0.05, 0.2, 0.6],
        noise="white",
        initial_state="zero",
        estimators=["ls", "awls", "ml"],
        harmonics=6,
        trend=None,
        replicates=1000,
        seed=1,
    )
    assert equal(toml_file.load(file(toml_file.EXAMPLE)), study)


def test_the_estimators_in_the_comments_of_the_example_can_be_used(file: Any, tmp_path: Path) -> None:
    (tmp_path / "my_functions.py").write_text("def mine(record, rng):\n    return [3, 8, 5]\n")
    inner = re.search(r"#   \[estimators\]\n(?:#   .*\n)+", toml_file.EXAMPLE)
    assert inner is not None
    text = re.sub(r"(?m)^(estimators|harmonics|trend) = .*\n", "", toml_file.EXAMPLE)
    study = toml_file.load(file(text + re.sub(r"(?m)^#   ", "", inner[0])))
    assert study.estimators == ("ml, wide band", "at rest", "heavy tails", "prior", "oe", "mine")


def test_what_is_known_has_the_words_of_python(file: Any) -> None:
    known = mf.TransferFunction(
        poles=2, zeros=0, params={"a1": mf.Free(2.9, sd=0.1), "a2": 8.0, "b0": mf.Free(min=0.0)}
    )
    late = mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(0.1, max=0.4, sd=0.05))
    study = mf.MonteCarlo(
        system=mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=64, nsr=0.1,
        estimators={
            "told": mf.Estimator(known, method="ml", harmonics=6),
            "late": mf.Estimator(late, harmonics=6),
            "rest": mf.Estimator(TF2, initial_state="rest", harmonics=6),
            "given": mf.Estimator(TF2, initial_state=[0.0, 0.5], harmonics=6),
        },
    )  # fmt: skip
    text = PLAIN.replace('estimators = ["ls"]\nharmonics = 6\n', "") + """
[estimators]
rest = { initial_state = "rest", harmonics = 6, model = { poles = 2, zeros = 0 } }
given = { initial_state = [0.0, 0.5], harmonics = 6, model = { poles = 2, zeros = 0 } }
[estimators.told]
method = "ml"
harmonics = 6
model = { poles = 2, zeros = 0, params = { a1 = { start = 2.9, sd = 0.1 }, a2 = 8.0, b0 = { min = 0 } } }
[estimators.late]
harmonics = 6
model = { poles = 2, zeros = 0, delay = { start = 0.1, max = 0.4, sd = 0.05 } }
"""  # fmt: skip
    made = toml_file.load(file(text))
    assert made.estimators == ("rest", "given", "told", "late")
    for one in made.plan.contenders:
        other = next(two for two in study.plan.contenders if two.name == one.name)
        assert one.estimators == other.estimators
    found = made.run(replicates=8)
    assert np.squeeze(found.sel(estimator="told").status["ok"]) == 8


@pytest.mark.parametrize(
    ("model", "says"),
    [
        (
            "params = { a1 = { start = 2.9, sd = 0.0 } }",
            r"params.a1: Free: sd=0.0 must be finite and above 0",
        ),
        ("params = { a1 = { mean = 2.9 } }", r"model.params.a1 has no key 'mean'"),
        ('params = { a1 = "three" }', r"give a number, or what is known of it, as"),
        ("delay = { start = 0.1, max = true }", r"model.delay.max = True; give a number"),
    ],
)
def test_what_is_known_wrongly_is_named(file: Any, model: str, says: str) -> None:
    text = PLAIN + f"model = {{ poles = 2, zeros = 0, {model} }}\n"
    with pytest.raises(mf.SpecError, match=says):
        toml_file.load(file(text))


FULL = """
input = { chirp = "sin(t**2/5)", held = [SAMPLES], own = "study_functions_more:ramp" }
duration = 8
intervals = 32
nsr = [0, 0.1]
noise = "study_functions_kit:coloured"
intersample = "foh"
replicates = 70
seed = 5
band = [0.5, 6.0]
trend = "linear"
cov_type = "nonrobust"
rule = "parabolic"
extended = false
tol = 1e-6
maxiter = 7
model = { poles = 2, zeros = 1, delay = 0.25 }

[system]
tf = { num = [5], den = [1, 3, 8], delay = 0.25 }
ss = { A = [[0, 1], [-8, -3]], B = [0, 1], C = [5, 0], delay = [0.25] }
own = "study_functions_more:SYSTEM"

[initial_state]
zero = "zero"
random = "random"
given = [1.0, 0.5]
own = "study_functions_kit:start"

[estimators]
ml = "ml"
wide = { method = "awls", harmonics = 9, noise = "equation" }
own = { model = { poles = 2, zeros = 0, delay = 0.25 }, band = 6.0, trend = "none" }
mine = "study_functions_more:mine"
pem = { rival = "pem", initial_state = "zero" }
arx = { rival = "arx", model = { poles = 2, zeros = 0, delay = 0.25 } }

[estimators.oe]
rival = "output_error"
initial_state = "zero"
trend = "constant"
maxiter = 30
start = { a1 = 2, a2 = 9, b0 = 0, b1 = 4 }

[metrics]
gain = "study_functions_kit:gain"
"""

MORE = """
import modfun as mf

SYSTEM = mf.tf([1], [1, 0.2, 1], delay=0.25)


def ramp(t):
    return t


def mine(rec, rng):
    return [3.0, 8.0, 0.0, 5.0]
"""


def test_every_key_reaches_its_argument(file: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "study_functions_more.py").write_text(MORE)
    monkeypatch.setattr(sys, "path", [*sys.path])
    samples = np.cos(np.arange(33)).tolist()
    found = toml_file.load(file(FULL.replace("SAMPLES", ", ".join(map(repr, samples)))))
    import study_functions_more as more  # type: ignore[import-not-found]

    model = mf.TransferFunction(poles=2, zeros=1, delay=0.25)
    late = mf.TransferFunction(poles=2, zeros=0, delay=0.25)
    start = {"a1": 2, "a2": 9, "b0": 0, "b1": 4}
    study = mf.MonteCarlo(
        system={
            "tf": mf.tf([5], [1, 3, 8], delay=0.25),
            "ss": mf.ss([[0, 1], [-8, -3]], [0, 1], [5, 0], delay=0.25),
            "own": more.SYSTEM,
        },
        input={"chirp": "sin(t**2/5)", "held": samples, "own": more.ramp},
        duration=8,
        intervals=32,
        nsr=[0, 0.1],
        noise=kit.coloured,
        initial_state={"zero": "zero", "random": "random", "given": [1.0, 0.5], "own": kit.start},
        intersample="foh",
        replicates=70,
        seed=5,
        band=(0.5, 6.0),
        trend="linear",
        cov_type="nonrobust",
        rule="parabolic",
        extended=False,
        tol=1e-6,
        maxiter=7,
        model=model,
        estimators={
            "ml": "ml",
            "wide": mf.Estimator(model, method="awls", harmonics=9, noise="equation"),
            "own": mf.Estimator(late, band=6.0, trend=None),
            "mine": more.mine,
            "pem": mf.rivals.pem(model, initial_state="zero"),
            "arx": mf.rivals.arx(late),
            "oe": mf.rivals.output_error(
                model, initial_state="zero", trend="constant", maxiter=30, start=start
            ),
        },
        metrics={"gain": kit.gain},
    )
    assert equal(found, study)


def test_records_of_the_users_own(file: Any) -> None:
    found = toml_file.load(
        file("""
        generate = "study_functions_kit:student"
        grid = { df = [3, 30] }
        truth = { a1 = 3.0, a2 = 8.0, b0 = nan }
        estimators = ["ls"]
        model = { poles = 2, zeros = 0 }
        harmonics = 6
        replicates = 10
        """)
    )
    study = mf.MonteCarlo(
        generate=kit.student,
        grid={"df": [3, 30]},
        truth={"a1": 3.0, "a2": 8.0, "b0": float("nan")},
        estimators=["ls"],
        model=TF2,
        harmonics=6,
        replicates=10,
    )
    assert equal(found, study)
    assert same(found.run(progress=False), study.run(progress=False))


def test_several_inputs(file: Any) -> None:
    text = PLAIN.replace('"sin(t**2/5)"', '["sin(t)", "cos(t**2)"]').replace(
        "{ num = [5], den = [1, 3, 8] }", "{ num = [[[5], [1, 1]]], den = [1, 3, 8] }"
    )
    found = toml_file.load(file(text + 'model = { poles = 2, zeros = [0, "none"] }\n'))
    study = mf.MonteCarlo(
        system=mf.tf([[[5], [1, 1]]], [1, 3, 8]), input=["sin(t)", "cos(t**2)"], duration=10.0, intervals=64,
        nsr=0.1, estimators=["ls"], harmonics=6, model=mf.TransferFunction(poles=2, zeros=[0, None]),
    )  # fmt: skip
    assert equal(found, study)


# What stands in the file instead of something in PLAIN (or below it), and what is said.
WRONG: dict[str, tuple[str, str, str]] = {
    "unknown key": ("", "replicate = 10", "no key 'replicate'; did you mean 'replicates'"),
    "option of a run": ("", 'keep = "samples"', "keep .* modfun mc run --keep"),
    "text for a number": ("10.0", '"ten"', "duration = 'ten'; give seconds"),
    "true for a number": ("64", "true", "intervals = True; give a whole number"),
    "a fraction for a count": ("", "replicates = 10.5", "replicates = 10.5; give a whole number"),
    "number for a word": ("", "trend = 1", 'trend = 1; give "none", "constant"'),
    "a word of Python": ("", 'trend = "None"', """trend = 'None'; give "none", "constant", "linear" or"""),
    "a list for a word": ("", "trend = [1]", r'trend = \[1\]; give "none", "constant"'),
    "table for a number": ("", "seed = { a = 1 }", "seed = {'a': 1}; give a whole number"),
    "texts for levels": ("nsr = 0.1", 'nsr = ["a"]', r"nsr = \['a'\]; give a number, or a list"),
    "a date for a signal": ('"sin(t**2/5)"', "2020-01-01", "input = .*; give a text in t"),
    "word of the system": ("den", "denn", "system has no key 'denn'; did you mean 'den'"),
    "system without den": (", den = [1, 3, 8]", "", "system lacks den"),
    "system in texts": ("[1, 3, 8]", '"s"', "system.den = 's'; give numbers"),
    "system refused": ("[1, 3, 8]", "[0]", "study.toml, line 8: system: mf.tf"),
    "system that is a number": ("{ num = [5], den = [1, 3, 8] }", "5", "system = 5; give a table"),
    "key astray below a header": (
        "system = { num = [5], den = [1, 3, 8] }",
        "[system.a]\nnum = [5]\nden = [1]\nseed = 3",
        r"system.a has no key 'seed'; .*seed stands below \[system.a\]",
    ),
    "key astray in estimators": (
        f"estimators = {ESTIMATORS}\nharmonics = 6\nsystem = {{ num = [5], den = [1, 3, 8] }}",
        '[estimators]\nls = "ls"\nseed = 3',
        r"estimators.seed = 3; .*seed stands below \[estimators\]",
    ),
    "unknown method": ('"ls"', '"lss"', "study.toml: there is no method 'lss'"),
    "no estimators": (f"estimators = {ESTIMATORS}", "", "study.toml: estimators=None; give a list"),
    "function without a name": ('"ls"', '"kit:f"', "estimators lists 'kit:f'; .* needs a name"),
    "option of an estimator": (
        ESTIMATORS,
        "{ a = { harmonic = 6, model = { poles = 2 } } }",
        "estimators.a has no key 'harmonic'; did you mean 'harmonics'",
    ),
    "estimator without model": (ESTIMATORS, "{ a = { harmonics = 6 } }", "estimators.a lacks model"),
    "estimator refused": (
        ESTIMATORS,
        '{ a = { method = "x", model = { poles = 2 } } }',
        "estimators.a: .*method='x'",
    ),
    "unknown rival": (ESTIMATORS, '{ a = { rival = "oe" } }', "rival = 'oe'; give one of output_error"),
    "option of another rival": (
        ESTIMATORS,
        '{ a = { rival = "arx", maxiter = 3 } }',
        "estimators.a has no key 'maxiter'",
    ),
    "structure": ("", "model = { pole = 2 }", "model = {'pole': 2}; give a table, as { poles = 2"),
    "structure refused": ("", "model = { poles = 2, zeros = 3 }", "study.toml, line 9: model: .*zeros"),
    "zeros": ("", 'model = { poles = 2, zeros = "no" }', "model.zeros = 'no'; give a whole number"),
    "grid": ("", "grid = { df = 3 }", "grid.df = 3; give a list"),
    "no module": ("", 'noise = "no_kit:f"', "noise = 'no_kit:f': there is no module no_kit"),
    "no function": (
        "",
        'noise = "study_functions_kit:colored"',
        "noise = .* has no colored; did you mean 'coloured'",
    ),
    "no function at all": ("", 'noise = "study_functions_kit:SIZE"', "is a float; give"),
    "noise in words": ("", 'noise = "pink"', "noise = 'pink'; give \"white\", or a function"),
    "metric in words": (
        "",
        'metrics = { m = "gain" }',
        "metrics.m = 'gain'; give a function .*\"module:name\"",
    ),
    "refused by the study": ("nsr = 0.1", "nsr = -1", "study.toml: nsr holds -1"),
    "no TOML": ("nsr =", "nsr = =", "study.toml: this is not TOML"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_named_with_its_place(case: str, file: Any) -> None:
    there, instead, said = WRONG[case]
    assert there in PLAIN
    text = PLAIN.replace(there, instead) if there else PLAIN + instead
    with pytest.raises(mf.SpecError, match=said) as caught:
        toml_file.load(file(text))
    assert "study.toml" in str(caught.value)


NESTED = """\
nsr = 0.1
system = { num = [5], den = [1, 3, 8] }
input.own = "t"

[estimators]
ls = "ls"
"ml, wide" = { method = "ml", harmonic = 6 }

[estimators.oe]
rival = "output_error"
[ estimators . 'a.b' ]
start.a1 = "x"
"""


@pytest.mark.parametrize(
    ("path", "line"),
    [
        (("nsr",), 1),
        (("system",), 2),
        (("system", "den"), 2),
        (("input",), 3),
        (("input", "own"), 3),
        (("estimators",), 5),
        (("estimators", "ls"), 6),
        (("estimators", "ml, wide", "harmonic"), 7),
        (("estimators", "oe"), 9),
        (("estimators", "oe", "rival"), 10),
        (("estimators", "a.b", "start"), 12),
        (("estimators", "a.b", "start", "a1"), 12),
        (("seed",), None),
        (("estimators", "oe", "seed"), None),
    ],
)
def test_a_nested_key_is_found_on_its_line(path: tuple[str, ...], line: int | None) -> None:
    assert line_of(path, NESTED) == line


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("[estimators.a]\nmethod = 'ml'\nharmonic = 6\n", "line 4: estimators.a has no key 'harmonic'"),
        ("[estimators.a]\nmethod = 'ml'\nharmonics = 0.5\n", "line 4: estimators.a.harmonics = 0.5"),
        ("keep = 'samples'\n", "line 2: keep is no part of a study"),
    ],
)
def test_what_is_wrong_in_a_table_is_said_with_its_line(more: str, said: str, file: Any) -> None:
    with pytest.raises(mf.SpecError, match=said):
        toml_file.load(file("nsr = 0.1\n" + more))


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(mf.SpecError, match="mc init"):
        toml_file.load(tmp_path / "study.toml")
    (tmp_path / "study.toml").write_bytes(b"a = '\xff'")
    with pytest.raises(mf.SpecError, match="not TOML"):
        toml_file.load(tmp_path / "study.toml")


def test_a_module_that_fails_says_why(file: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "study_kit_broken.py").write_text("1 / 0\n")
    with pytest.raises(mf.SpecError, match=r"cannot be imported: ZeroDivisionError"):
        toml_file.load(file(PLAIN + 'noise = "study_kit_broken:f"'))
    (tmp_path / "study_kit_needy.py").write_text("import no_such_package\n")
    with pytest.raises(mf.SpecError, match=r"cannot be imported: .*no_such_package"):
        toml_file.load(file(PLAIN + 'noise = "study_kit_needy:f"'))


def test_a_module_that_leaves_python_is_an_error(
    file: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "study_kit_leaving.py").write_text("raise SystemExit(0)\n")
    with pytest.raises(mf.SpecError, match=r"noise = .* cannot be imported: SystemExit: 0"):
        toml_file.load(file(PLAIN + 'noise = "study_kit_leaving:f"'))


def test_the_study_files_of_the_docs_are_understood(file: Any) -> None:
    found = re.findall(
        r"^```toml\n(.*?)^```$", (ROOT / "docs/monte_carlo.md").read_text(), re.DOTALL | re.MULTILINE
    )
    assert found
    for text in found:
        toml_file.load(file(text))
