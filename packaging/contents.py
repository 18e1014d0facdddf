"""Looks into wheels and source distributions: nothing missing, nothing too much, loadable by old systems.

python packaging/contents.py dist
"""

import io
import re
import subprocess
import sys
import tarfile
import tempfile
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LICENCES = {"LICENSE", "THIRD_PARTY_LICENSES"}
CORE = {"_core.abi3.so", "_core.pyd"}
# What manylinux2014 systems have. Their libm and libgcc count for `fma` and unwinding.
LIBRARIES = {"libc.so.6", "libm.so.6", "libgcc_s.so.1", "libpthread.so.0", "libdl.so.2"}
LIBRARIES |= {"ld-linux-x86-64.so.2", "ld-linux-aarch64.so.1"}
GLIBC = (2, 17)


def tracked(folder: str) -> set[str]:
    """Files of the repository under a folder, their names from there."""
    told = subprocess.run(["git", "ls-files", folder], cwd=ROOT, check=True, capture_output=True, text=True)
    return {name.removeprefix(folder + "/") for name in told.stdout.splitlines()}


def different(what: str, found: set[str], wanted: set[str]) -> list[str]:
    return [f"{what} lacks {name}" for name in sorted(wanted - found)] + [
        f"{what} holds {name}" for name in sorted(found - wanted)
    ]


def symbols(library: bytes) -> list[str]:
    """What a Linux library asks for that manylinux2014 does not promise."""
    with tempfile.NamedTemporaryFile() as file:
        file.write(library)
        file.flush()
        told = subprocess.run(["objdump", "-p", file.name], check=True, capture_output=True, text=True).stdout
        names = subprocess.run(
            ["objdump", "-t", file.name], check=True, capture_output=True, text=True
        ).stdout
    said = [f"needs {name}" for name in re.findall(r"NEEDED\s+(\S+)", told) if name not in LIBRARIES]
    versions = {tuple(map(int, found.split("."))) for found in re.findall(r"GLIBC_([\d.]+)", told)}
    said += [f"needs glibc {version}" for version in sorted(versions) if version > GLIBC]
    return said + (["is not stripped"] if "no symbols" not in names else [])


def wheel(path: Path) -> list[str]:
    """What is wrong with a wheel."""
    with zipfile.ZipFile(path) as archive:
        names = [name for name in archive.namelist() if not name.endswith("/")]
        info = f"{'-'.join(path.name.split('-')[:2])}.dist-info"
        package = {name.removeprefix("modfun/") for name in names if name.startswith("modfun/")}
        core = package & CORE
        said = different("the package", package - core, tracked("python/modfun"))
        licences = {Path(name).name for name in names if name.startswith(f"{info}/licenses/")}
        said += different("the folder of licences", licences, LICENCES)
        said += [f"{name} is of nobody" for name in names if not name.startswith(("modfun/", f"{info}/"))]
        if len(core) != 1:
            said.append(f"holds {len(core)} compiled cores")
        elif "manylinux" in path.name:
            said += [f"the core {word}" for word in symbols(archive.read(f"modfun/{core.pop()}"))]
    if "-cp311-abi3-" not in path.name:
        said.append("is not for every Python from 3.11 on")
    return said


def sdist(path: Path) -> list[str]:
    """What is wrong with a source distribution."""
    with tarfile.open(path) as archive:
        top = path.name.removesuffix(".tar.gz") + "/"
        names = {member.name.removeprefix(top) for member in archive.getmembers() if member.isfile()}
        lock = archive.extractfile(top + "Cargo.lock")
        packages = tomllib.load(io.BytesIO(lock.read()))["package"] if lock else []
        file = archive.extractfile(top + ".cargo/config.toml")
        config = file.read().decode() if file else ""
    vendored = {name.split("/")[1] for name in names if name.startswith("vendor/")}
    crates = {package["name"] for package in packages if "source" in package}
    said = different("vendor", vendored, crates)
    if "vendor" not in config:
        said.append("does not say that its crates are in vendor")
    for folder in ("python", "rust"):
        held = {name.removeprefix(folder + "/") for name in names if name.startswith(folder + "/")}
        said += different(folder, held, tracked(folder))
    wanted = LICENCES | {"PKG-INFO", "README.md", "pyproject.toml"}
    return said + [f"lacks {name}" for name in sorted(wanted - names)]


def main() -> int:
    wrong = 0
    found = [path for folder in sys.argv[1:] for path in sorted(Path(folder).iterdir())]
    for path in found:
        said = wheel(path) if path.suffix == ".whl" else sdist(path)
        print(f"{path}: {path.stat().st_size:,} bytes, {'; '.join(said) or 'as it should be'}")
        wrong += bool(said)
    return wrong or not found


if __name__ == "__main__":
    sys.exit(main())
