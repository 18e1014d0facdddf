"""Writes dist/modfun-VERSION.tar.gz: the sources with all crates they need, to be built without a network.

maturin's own source distribution is unpacked, what only tests and benches need leaves `Cargo.toml`, the
crates that remain in `Cargo.lock` are put into `vendor/`, and `.cargo/config.toml` says so. The same commit
gives the same bytes.
"""

import argparse
import gzip
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CONFIG = """\
[source.crates-io]
replace-with = "vendored"

[source.vendored]
directory = "vendor"
"""
UNUSED = re.compile(r"\[dev-dependencies\]|\[\[(?:test|bench|example)\]\]")


def run(*command: str, at: Path = ROOT) -> str:
    return subprocess.run(command, cwd=at, check=True, stdout=subprocess.PIPE, text=True).stdout


def locked(folder: Path) -> set[tuple[str, str]]:
    """Names and versions of the lock file."""
    lock = tomllib.loads(folder.joinpath("Cargo.lock").read_text("utf-8"))
    return {(package["name"], package["version"]) for package in lock["package"]}


def shorten(folder: Path) -> None:
    """Takes tests and benches out of the sources."""
    manifest = folder / "Cargo.toml"
    sections = re.split(r"(?m)^(?=\[)", manifest.read_text("utf-8"))
    manifest.write_text("".join(part for part in sections if not UNUSED.match(part)), "utf-8")
    for name in ("benches", "tests"):
        shutil.rmtree(folder / name, ignore_errors=True)


def vendor(folder: Path) -> None:
    """Puts the crates into the sources, of the versions that were tested."""
    run("cargo", "vendor", "--quiet", "vendor", at=folder)
    config = folder / ".cargo" / "config.toml"
    config.parent.mkdir()
    config.write_text(CONFIG, "utf-8")
    if foreign := locked(folder) - locked(ROOT):
        raise SystemExit(f"versions differ from those of Cargo.lock: {sorted(foreign)}")


def pack(folder: Path, archive: Path, moment: int) -> None:
    """A .tar.gz of the folder that depends on its files alone."""

    def plain(member: tarfile.TarInfo) -> tarfile.TarInfo:
        member.uid = member.gid = 0
        member.uname = member.gname = ""
        member.mtime = moment
        member.mode = 0o755 if member.isdir() or member.mode & 0o100 else 0o644
        return member

    with (
        archive.open("wb") as raw,
        gzip.GzipFile("", "wb", 9, raw, mtime=moment) as packed,
        tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as tar,
    ):
        for path in sorted(folder.rglob("*")):
            tar.add(path, str(path.relative_to(folder.parent)), recursive=False, filter=plain)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="the folder that it is written to")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    moment = os.environ.get("SOURCE_DATE_EPOCH") or run("git", "log", "-1", "--format=%ct").strip()
    with tempfile.TemporaryDirectory() as scratch:
        run(sys.executable, "-m", "maturin", "sdist", "--out", scratch)
        (plain,) = Path(scratch).glob("*.tar.gz")
        with tarfile.open(plain) as tar:
            tar.extractall(scratch, filter="data")
        folder = Path(scratch, plain.name.removesuffix(".tar.gz"))
        shorten(folder)
        vendor(folder)
        pack(folder, out / plain.name, int(moment))
    print(f"{out / plain.name}: {(out / plain.name).stat().st_size:,} bytes")
    return 0


if __name__ == "__main__":
    sys.exit(main())
