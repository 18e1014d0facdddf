"""Texts and files again, guided by coverage: what reaches a new line of modfun is kept and changed further.

    pip install -r fuzz/requirements.txt
    python fuzz/python/guided.py KIND --seconds 60 [FILE]

The kinds are those of `texts.py`, whose cases are the seeds; only modfun's own modules are watched, since to
instrument SciPy and SymPy takes minutes. Equations are read and not compiled. With FILE that one is tried.
What ends neither in a result nor in a ModfunError is written into the folder where the command is called.
"""

from __future__ import annotations

import argparse
import os
import pkgutil
import sys
import tempfile
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import atheris

SEEDS = 400
TIMEOUT = 20  # seconds a case
MEMORY = 4096  # MB

with atheris.instrument_imports(include=["modfun"]):
    import boundary
    import modfun as mf
    import texts

    for module in pkgutil.walk_packages(mf.__path__, "modfun."):
        if not module.name.endswith("__main__"):
            import_module(module.name)
    from modfun.equations.symbolic import parser


def how(kind: str, content: bytes) -> object:
    if kind in ("equation", "signal"):
        content = content.decode("utf-8", "replace").encode()
    if kind == "equation":
        return parser.equation(texts.text_of(content))
    if kind == "fit":
        # What stands in a file need not be what a fit could have been: it is read or refused.
        texts.KINDS[kind][1](content)
        return None
    return texts.KINDS[kind][1](content)


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("kind", choices=texts.KINDS)
    asked.add_argument("file", nargs="?", type=Path)
    asked.add_argument("--seconds", type=int, default=60)
    args = asked.parse_args()
    here = Path.cwd()

    def one(content: bytes) -> None:
        _, error = boundary.outcome(SimpleNamespace(function=lambda: how(args.kind, content)), {})  # type: ignore[arg-type]
        if error is not None:
            raise error

    scratch = Path(tempfile.mkdtemp())
    corpus = scratch / "corpus"
    corpus.mkdir()
    for number in range(SEEDS):
        corpus.joinpath(str(number)).write_bytes(texts.case(args.kind, 0, number))
    words = scratch / "words"
    words.write_text("".join(f'"{word}"\n' for word in {*texts.ATOMS, *texts.CALLS}), "ascii")
    options = [f"-max_total_time={args.seconds}", f"-timeout={TIMEOUT}", f"-rss_limit_mb={MEMORY}"]
    options += [f"-artifact_prefix={here}/{args.kind}-", f"-dict={words}", "-max_len=8192"]
    given = str(args.file.resolve()) if args.file else str(corpus)
    os.chdir(scratch)
    atheris.Setup([sys.argv[0], *options, given], one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
