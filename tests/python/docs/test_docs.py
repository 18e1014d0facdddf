"""What the documents show is true: code runs, commands and names exist, links lead somewhere.

Blocks of the pages in docs/records read records that are not part of the project: they run in the folder that
MODFUN_DATA names, else in ../shared/data beside the repository, and are skipped where it is absent.
"""

import importlib
import re
import shlex
import subprocess
import sys
import tomllib
import warnings
from functools import cache

import matplotlib
import modfun as mf
import pytest
from places import ROOT, measured

SAMPLES = {"docs/flight.md": ("flight_test", "run7.csv")}  # pages that read a sample file
PAGES = [
    page
    for page in [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
    if not page.name.startswith(".")
]
# Pages whose blocks follow one another: these, and those that the site runs (docs/conf.py).
CONTINUED = [
    str(page.relative_to(ROOT))
    for page in PAGES
    if re.match(
        r"README\.md|docs/(flight\.md|known\.md|tour\.md|howto/|explanation/)", str(page.relative_to(ROOT))
    )
]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def blocks(language):
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for found in FENCE.finditer(text):
            if found[1] == language:
                line = text[: found.start()].count("\n") + 2
                yield pytest.param(page, found[2], line, id=f"{page.name}:{line}")


SECTIONS = [
    "docs/index.md",
    "docs/start.md",
    "docs/guides.md",
    "docs/examples.md",
    "docs/evidence.md",
    "docs/development.md",
]  # and READMEs of folders


def test_every_page_has_its_place_in_the_site():
    """Linked from one section page, a README of a folder or one of SECTIONS: the site's table of contents."""
    placed = []
    for section in [*(ROOT / name for name in SECTIONS), *(ROOT / "docs").glob("*/README.md")]:
        text = section.read_text(encoding="utf-8")
        links = dict.fromkeys(re.findall(r"\]\((?!https?:)([^)\s#]+\.md)\)", prose(section)))
        if section.name == "index.md":
            contents = re.search(r"```\{toctree\}\n(.*?)```", text, re.DOTALL)[1].split()
            links = [f"{name}.md" for name in contents if name != ":hidden:"]
        placed += [(section.parent / link).resolve() for link in links]
    pages = sorted((ROOT / "docs").rglob("*.md"))
    pages.remove(ROOT / "docs" / "index.md")
    assert sorted(path for path in placed if path.suffix == ".md" and path.exists()) == pages


def separate_blocks():
    return [block for block in blocks("python") if str(block.values[0].relative_to(ROOT)) not in CONTINUED]


def prose(page):
    """The page without its blocks of code."""
    return FENCE.sub("", page.read_text(encoding="utf-8"))


def test_the_pages_are_there():
    assert {"README.md", "architecture.md", "accuracy.md"} <= {page.name for page in PAGES}
    assert list(blocks("python"))


def shown_behind(page, line, code):
    """The ```text block right behind the block of code that begins in a line."""
    rest = page.read_text(encoding="utf-8").split("\n")[line - 1 + code.count("\n") :]
    found = re.match(r"```\n\n```text\n(.*?)^```$", "\n".join(rest), re.DOTALL | re.MULTILINE)
    return found[1].rstrip() if found else ""


@pytest.mark.parametrize("name", CONTINUED)
def test_blocks_that_follow_one_another_run_without_a_warning(name, tmp_path, monkeypatch, capsys):
    matplotlib.use("Agg")
    from matplotlib import pyplot

    if name in SAMPLES:
        example, sample = SAMPLES[name]
        monkeypatch.syspath_prepend(str(ROOT / "examples"))
        importlib.import_module(example).write_sample(tmp_path / sample)
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "__main__"}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for page, code, line in (block.values for block in blocks("python")):
            if page == ROOT / name:
                exec(compile("\n" * (line - 1) + code, str(page), "exec"), names)
                printed = re.sub(r" +$", "", capsys.readouterr().out, flags=re.MULTILINE).rstrip()
                pyplot.close("all")
                if name not in SAMPLES:  # which shows parts of what it prints
                    told = "python docs/outputs.py writes it anew"
                    assert shown_behind(page, line, code) == printed, f"{name}:{line}: {told}"


@pytest.mark.parametrize(("page", "code", "line"), separate_blocks())
def test_python_blocks_run_without_a_warning(page, code, line, tmp_path, monkeypatch, capsys):
    matplotlib.use("Agg")
    folder = tmp_path
    if page.parent.name == "records":
        folder = measured()
    if "from distributed import" in code:  # needed by no extra
        pytest.importorskip("distributed")
    monkeypatch.chdir(folder)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        if page.parent.name == "records" and "`mf.fit` warns" in page.read_text(encoding="utf-8"):
            import modfun

            warnings.simplefilter("default", modfun.ModfunWarning)
        exec(compile("\n" * (line - 1) + code, str(page), "exec"), {"__name__": "__main__"})
    printed = re.sub(r" +$", "", capsys.readouterr().out, flags=re.MULTILINE).rstrip()
    if page.parent.name != "records":  # which show tables of more than their blocks
        told = "python docs/outputs.py writes it anew"
        assert shown_behind(page, line, code) in ("", printed), f"{page.name}:{line}: {told}"


@pytest.mark.process
def test_make_demo_installs_what_readme_needs(tmp_path):
    """README's blocks, where every optional package outside the extras of `make demo` cannot be imported."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]
    demo = re.search(r'"\.\[([a-z,]+)\]"', (ROOT / "Makefile").read_text("utf-8"))[1].split(",")
    installed = {need for extra in demo for need in extras[extra]}
    absent = {re.match(r"\w+", need)[0] for need in set(extras["all"]) - installed}
    assert absent, "there is something to leave out"
    code = "\n".join(block.values[1] for block in blocks("python") if block.values[0] == ROOT / "README.md")
    refuse = f"import sys\nfor name in {sorted(absent)}:\n    sys.modules[name] = None\n"
    done = subprocess.run(
        [sys.executable, "-c", refuse + code + "\nimport modfun.commands.app"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "fit.html").exists()


def test_the_sample_of_the_tour_is_that_of_the_command(tmp_path, monkeypatch, capsys):
    from modfun.commands.main import main

    monkeypatch.chdir(tmp_path)
    tour = next(block.values for block in blocks("python") if block.values[0].name == "tour.md")
    exec(tour[1], {})
    assert main(["sample", "other.csv"]) == 0
    assert (tmp_path / "flight.csv").read_bytes() == (tmp_path / "other.csv").read_bytes()


def command_lines():
    for block in blocks("sh"):
        page, code, line = block.values
        for offset, text in enumerate(code.splitlines()):
            if text.startswith("modfun "):
                yield pytest.param(text, id=f"{page.name}:{line + offset}")
    for page in PAGES:
        for text in re.findall(r"`(modfun [a-z][^`|…]*)`", prose(page)):
            yield pytest.param(text, id=f"{page.name}:{text}")


@cache
def whole_command():
    import typer
    from modfun.commands.app import app

    return typer.main.get_command(app)


@pytest.mark.parametrize("line", list(command_lines()))
def test_command_lines_are_understood(line):
    """Parsed to the last word by the command's own parser; nothing is run."""
    words, command, context = shlex.split(line, comments=True)[1:], whole_command(), None
    while hasattr(command, "commands"):
        context = command.make_context("modfun", [], parent=context, resilient_parsing=True)
        command, words = command.commands[words[0]], words[1:]
    if words:  # a bare name in prose names the command
        command.make_context(command.name, words, parent=context)


def test_make_targets_exist():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z-]+):", makefile, re.MULTILINE))
    for page in PAGES:
        named = re.findall(r"(?:^|`)make ([a-z-]+)", page.read_text(encoding="utf-8"), re.MULTILINE)
        assert set(named) <= targets, page.name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        other = (page.parent / path).resolve() if path else page
        assert other.exists(), f"{page.name}: {target}"
        if anchor:
            heads = re.findall(r"^#+ (.+)$", other.read_text(encoding="utf-8"), re.MULTILINE)
            slugs = {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}
            assert anchor in slugs, f"{page.name}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_named_exist(page):
    """Paths in code type that start in a folder of the project."""
    folders = "rust|python|tests|docs|examples|benches|fuzz|packaging"
    for path in re.findall(rf"`((?:{folders})/[\w./-]*)`", prose(page)):
        assert (ROOT / path).exists(), f"{page.name}: {path}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_tests_named_exist(page):
    """`tests/…/file.py::test_name`, and the same for tests in Rust."""
    for path, name in re.findall(r"`([\w./]+\.(?:py|rs))::(\w+)`", prose(page)):
        text = (ROOT / path).read_text(encoding="utf-8")
        assert re.search(rf"(?:def|fn) {name}\b", text), f"{page.name}: {path}::{name}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_public_names_mentioned_exist(page):
    kinds = {"mf": mf, "fit": mf.Fit, "rec": mf.Record}
    for text in re.findall(r"`([^`\n]+)`", prose(page)):
        for root, dotted in re.findall(r"(?<![\w./])(mf|fit|rec)\.([a-zA-Z][\w.]*)", text):
            value = kinds[root]
            for name in dotted.rstrip(".").split("."):
                bases = getattr(value, "__mro__", ())
                told = any(name in vars(base).get("__annotations__", {}) for base in bases)
                known = hasattr(value, name) or told
                assert known, f"{page.name}: {root}.{dotted}"
                value = getattr(value, name, None)
                if isinstance(value, property):  # what it returns, where that is a class of ours
                    value = getattr(mf, value.fget.__annotations__["return"], None)
                if value is None:
                    break


def test_no_page_or_example_silences_a_warning():
    """A warning that is right is shown, on a page by its text; one that is wrong is a fault of modfun."""
    scripts = [*PAGES, *(ROOT / "examples").rglob("*.py")]
    assert len(scripts) > 100
    silencing = re.compile(r"(simplefilter|filterwarnings)\(\s*[\"']ignore|action=[\"']ignore")
    assert not [path.name for path in scripts if silencing.search(path.read_text(encoding="utf-8"))]


@pytest.mark.process
@pytest.mark.parametrize("name", ["fit_simulated", "flight_record", "feedback_collinearity"])
def test_examples_run(name, tmp_path):
    done = subprocess.run(
        [sys.executable, "-W", "error", str(ROOT / "examples" / f"{name}.py")],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "parameter" in done.stdout
    assert not list(tmp_path.iterdir()), "an example leaves nothing behind"


def test_the_flight_example_reads_a_file_of_your_own(tmp_path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(ROOT / "examples"))
    import flight_record

    flight_record.write_sample(tmp_path / "run7.csv")
    fit = flight_record.main([str(tmp_path / "run7.csv")])
    truth = {"a1": 1.8, "a2": 5.0, "b0": -4.0, "b1": -3.0}
    # Four standard errors of four parameters: false alarm under 1 in 1,000, and the seed is fixed.
    for name, se in zip(fit.param_names, fit.bse, strict=True):
        assert abs(fit[name] - truth[name]) < 4 * se
    assert "has not seen" in capsys.readouterr().out
