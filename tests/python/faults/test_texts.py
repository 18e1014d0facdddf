"""Nothing of a text is ever run, however it is written; texts and files by machine: fuzz/python/texts.py."""

from __future__ import annotations

import io
import json
import signal
import subprocess
import sys
import time
import tokenize
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import modfun as mf
import pytest
from modfun.language.evaluate import function_of
from modfun.signals.sources import evaluate
from modfun.study import toml_file
from places import ROOT

FUZZ = ROOT / "fuzz" / "python"

pytestmark = pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")


# Nothing is run ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a child process saw under an audit hook; a hook cannot be taken away again."""
    folder = tmp_path_factory.mktemp("injected")
    done = subprocess.run(
        [sys.executable, "-W", "ignore", str(FUZZ / "injected.py")],
        cwd=folder, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    report: dict[str, Any] = json.loads(done.stdout)
    return report


@pytest.mark.process
def test_the_hook_sees_what_is_run(told: dict[str, Any]) -> None:
    assert told["run"] == ["compile <string>", "exec <module> of <string>", "open run"]


@pytest.mark.process
def test_no_text_is_run(told: dict[str, Any]) -> None:
    """No import, file, process, socket or code but what a harmless text with a fault causes."""
    assert told["attempts"] > 1000
    assert told["wrong"] == []
    assert told["files"] == ["run", "study.toml"]


@pytest.mark.process
def test_generated_code_holds_no_name_of_a_text(told: dict[str, Any]) -> None:
    """`exec`, `open` and `eval` are fair names of parameters: in generated code they have others."""
    assert told["named"] == "a result"
    assert told["sources"]
    for source in told["sources"]:
        words = [one for one in tokenize.generate_tokens(io.StringIO(source).readline)]
        names = {one.string.rstrip("0123456789") for one in words if one.type == tokenize.NAME}
        own = {"def", "return", "_lambdifygenerated", "_Dummy_", "x", "True", "default", "nan"}
        assert names - own <= {"select", "less", "abs", "maximum", "reduce"}  # of NumPy
        assert not [one for one in words if one.type == tokenize.STRING]


# Long and deep -----------------------------------------------------------------------------------

LONG = {
    "parentheses": "(" * 10**5 + "y" + ")" * 10**5,
    "open parentheses": "(" * 10**5,
    "brackets": "[" * 10**5,
    "primes": "y" + "'" * 10**5,
    "signs": "-" * 10**5 + "y",
    "powers": "2**" * 10**5 + "2",
    "calls": "sin(" * 10**5 + "t" + ")" * 10**5,
    "sum": "+".join(["t"] * 500_000),
    "name": "y" * 10**6,
    "digits": "9" * 10**6,
    "blanks": " " * 10**6,
    "lines": "\n" * 10**6 + "t",
    "as long as is read": "(" * 450 + "t" + ")" * 450,
    "as deep as is read": "-" * 900 + "t",
}


def study(text: str) -> Any:
    Path("study.toml").write_text(
        f'input = {json.dumps(text)}\nduration = 1.0\nintervals = 8\nnsr = 0.1\nestimators = ["ls"]\n'
        "harmonics = 2\nsystem = { num = [1], den = [1, 1] }\n"
    )
    return toml_file.load("study.toml")


TAKES: dict[str, Callable[[str], Any]] = {
    "equation": lambda x: mf.Equation(f"y' + {x} = u").compiled(),
    "entry": lambda x: mf.StateSpace([[x]], [1]).compiled(),
    "signal": lambda x: evaluate(x, [0.0, 1.0]),
    "expression": lambda x: function_of(x, ["y"]),
    "input": lambda x: mf.simulate(mf.tf([1], [1, 1]), input=x, duration=1.0, intervals=8),
    "study": study,
}


@pytest.mark.parametrize("take", TAKES)
@pytest.mark.parametrize("what", LONG)
def test_long_and_deep_texts(what: str, take: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    started = time.monotonic()
    with pytest.raises(mf.ModfunError) as caught:
        TAKES[take](LONG[what])
    assert time.monotonic() - started < 20
    assert len(str(caught.value)) < 1500


@pytest.mark.parametrize("take", ["equation", "signal"])
def test_a_tower_of_powers(take: str) -> None:
    """Short, and no computer could hold its digits."""
    started = time.monotonic()
    with pytest.raises(mf.ModfunError, match=r"inf at t|floating point"):
        TAKES[take]("9**" * 40 + "9")
    assert time.monotonic() - started < 20


# By machine --------------------------------------------------------------------------------------


@pytest.fixture
def texts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.syspath_prepend(str(FUZZ))
    monkeypatch.chdir(tmp_path)
    import texts

    before = signal.signal(signal.SIGALRM, texts._alarm)
    yield texts
    signal.signal(signal.SIGALRM, before)


def test_a_few_thousand_texts_and_files(texts: Any) -> None:
    counts, defects = texts.run(list(texts.KINDS), 3000, seed=1)
    assert not defects, "\n".join(f"{where}: {case}: {text}" for where, (case, text) in defects.items())
    for kind, count in counts.items():
        assert count["result"] > 3, kind  # else nothing but the first look at a file was tried
        assert count["SpecError"] + count["DataError"] > 10, kind


# The other folders are of the targets in fuzz/fuzz_targets.
KINDS = ("equation", "signal", "csv", "npz", "mat", "fit", "study")
CORPUS = sorted(path for kind in KINDS for path in (ROOT / "fuzz" / "corpus" / kind).glob("*"))


@pytest.mark.parametrize("path", CORPUS, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_what_was_found(texts: Any, path: Path) -> None:
    ended, error = texts.tried(path.parent.name, path.read_bytes())
    assert ended != "defect", repr(error)
