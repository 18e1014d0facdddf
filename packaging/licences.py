"""Writes THIRD_PARTY_LICENSES: the licence texts of every crate that is linked into the compiled core.

    python packaging/licences.py            writes the file; a toolchain with its documentation is needed
    python packaging/licences.py --check    says what the file lacks, and fails if it lacks anything

Linked are the normal dependencies of the extension, with the features it is built with, on any system that
wheels are made for. Procedural macros run at build time alone and are left out. Of a choice of licences the
first of `TAKEN` is taken, and its text is copied from the crate's own sources.
"""

import argparse
import html
import json
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
FILE = ROOT / "THIRD_PARTY_LICENSES"
# Permissive licences, in the order of choice, and a phrase that their texts hold.
TAKEN = {
    "MIT": "Permission is hereby granted, free of charge",
    "BSD-2-Clause": "Redistribution and use in source and binary forms",
    "BSD-3-Clause": "Redistribution and use in source and binary forms",
    "Zlib": "This software is provided 'as-is'",
    "Apache-2.0": "Apache License",
    "Unicode-3.0": "UNICODE LICENSE V3",
}
HEAD = """\
modfun itself is under the BSD 3-Clause licence, see LICENSE. Its compiled core contains the libraries below,
each under the licence that stands there. Written by packaging/licences.py; do not edit.
"""
RULE = "=" * 80
STANDARD = "Rust standard library"
# Its own dependencies on the systems that wheels are made for.
IN_STANDARD = ("cfg-if", "gimli", "hashbrown", "libc", "rustc-demangle")


class Crate(NamedTuple):
    """A library that is linked: its name, version, the licence taken, and that licence's texts."""

    name: str
    version: str
    licence: str
    text: str

    @property
    def heading(self) -> str:
        return f"{self.name} {self.version}: {self.licence}"


def chosen(expression: str) -> str:
    """The licence taken of those offered, as in "MIT OR Apache-2.0" or "MIT/Apache-2.0"."""
    offered = re.split(r"\s+OR\s+|/", expression.strip("()"))
    for licence in TAKEN:
        if licence in offered:
            return licence
    raise SystemExit(f"licence {expression!r} is none of {', '.join(TAKEN)}: look at it, then add or replace")


def texts(package: dict[str, Any], licence: str) -> str:
    """The licence files of a crate that hold the text taken, and its notices if there are any.

    Where a crate says MIT and brings no text, the licence's own stands with the holders it names.
    """
    phrase, folder = TAKEN[licence], Path(package["manifest_path"]).parent
    found = [
        text.strip()
        for path in sorted(folder.iterdir())
        if re.match(r"(LICEN[CS]E|COPYING|NOTICE)", path.name, re.IGNORECASE) and path.is_file()
        if phrase in (text := path.read_text("utf-8")) or path.name.upper().startswith("NOTICE")
    ]
    if not any(phrase in text for text in found):
        if licence == "MIT":
            people = ", ".join(name.removesuffix(" <>") for name in package["authors"])
            holders = f"{people or 'the authors'} ({package['repository']})"
            return "\n\n".join([mit(holders), *found])
        raise SystemExit(f"{folder.name}: no file with the text of {licence}")
    return "\n\n".join(found)


def run(*command: str) -> str:
    return subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout


def linked() -> list[tuple[str, str]]:
    """Names and versions of the foreign crates in the extension."""
    tree = run(
        *(
            "cargo",
            "tree",
            "--locked",
            "--offline",
            "--package",
            "modfun-py",
            "--edges",
            "normal,no-proc-macro",
        ),
        *("--target", "all", "--prefix", "none", "--format", "{p}"),
    )
    pairs = {tuple(line.replace(" v", " ").split()[:2]) for line in tree.splitlines()}
    return sorted((name, version) for name, version in pairs if not name.startswith("modfun"))


def crates() -> list[Crate]:
    """The linked crates with the texts from their sources."""
    described = json.loads(run("cargo", "metadata", "--locked", "--offline", "--format-version=1"))
    at = {(package["name"], package["version"]): package for package in described["packages"]}
    found = []
    for pair in linked():
        licence = chosen(at[pair]["license"])
        found.append(Crate(*pair, licence, texts(at[pair], licence)))
    return found


@cache
def notices() -> Path:
    """The toolchain's folder of licences and notices."""
    folder = Path(run("rustc", "--print", "sysroot").strip(), "share", "doc", "rust")
    if not folder.is_dir():
        raise SystemExit(f"{folder} is not there: install the toolchain's documentation (rust-docs)")
    return folder


def mit(holders: str) -> str:
    """The text of the MIT licence."""
    text = notices().joinpath("licenses", "MIT.txt").read_text("utf-8")
    return text.replace("<year> <copyright holders>", holders).strip()


def standard_library() -> list[Crate]:
    """What every Rust library contains, as the toolchain's own page of notices tells it."""
    folder, own = notices(), mit("The Rust Project Developers")
    tables = folder.joinpath("licenses", "Unicode-3.0.txt").read_text("utf-8")
    text = f"{own}\n\n{tables}".strip()
    found = [Crate(STANDARD, "with its tables of characters", "MIT, Unicode-3.0", text)]
    page = folder.joinpath("COPYRIGHT-library.html").read_text("utf-8")
    for part in page.split("<h3>📦 ")[1:]:
        name, version = part[: part.index("<")].rsplit("-", 1)
        if name in IN_STANDARD:
            texts = [html.unescape(text).strip() for text in re.findall(r"<pre>(.*?)</pre>", part, re.DOTALL)]
            text = "\n\n".join(text for text in texts if TAKEN["MIT"] in text)
            found.append(Crate(f"{STANDARD}, {name}", version, "MIT", text))
    return found


def written(found: list[Crate]) -> str:
    """The file of these crates."""
    parts = [f"{RULE}\n{crate.heading}\n{RULE}\n\n{crate.text}\n" for crate in found]
    lines = "\n".join([HEAD, *parts]).splitlines()
    return "\n".join(line.rstrip() for line in lines) + "\n"


def lacking(text: str, found: list[Crate]) -> list[str]:
    """What of these crates the text of the file lacks, and what it holds of others."""
    headings = re.findall(rf"^{RULE}\n(.+)\n{RULE}$", text, re.MULTILINE)
    wanted = {crate.heading for crate in found}
    said = [f"missing: {heading}" for heading in sorted(wanted - set(headings))]
    foreign = [heading for heading in headings if not heading.startswith(STANDARD)]
    said += [f"not linked: {heading}" for heading in foreign if heading not in wanted]
    body = " ".join(text.split())
    return said + [f"text: {crate.heading}" for crate in found if " ".join(crate.text.split()) not in body]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing, say what is lacking")
    if parser.parse_args().check:
        said = lacking(FILE.read_text("utf-8"), crates())
        print("\n".join(said) or "every linked crate is there with its text")
        return bool(said)
    FILE.write_text(written([*crates(), *standard_library()]), "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
