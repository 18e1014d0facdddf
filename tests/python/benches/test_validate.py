"""Everything that the sections of `make validate` import, wherever they do, is there."""

import subprocess
import sys

from places import ROOT

CODE = """
import ast, importlib, pathlib, sys
sys.path.insert(0, "benches/validate")
import validate  # sets the path of the sections
count = 0
for path in sorted(pathlib.Path("benches/validate").glob("*.py")):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            module = importlib.import_module(node.module)
            for one in node.names:
                if not hasattr(module, one.name):
                    importlib.import_module(f"{node.module}.{one.name}")
                count += 1
        elif isinstance(node, ast.Import):
            count += len([importlib.import_module(one.name) for one in node.names])
print(count)
"""


def test_imports_of_every_section_are_found():
    done = subprocess.run([sys.executable, "-c", CODE], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[-1]) > 150
