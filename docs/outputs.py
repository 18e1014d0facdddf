"""What the blocks of pages print and draw, written behind them for readers on a code host.

python docs/outputs.py docs/tour.md docs/howto/*.md docs/explanation/*.md

The blocks of a page run in order in an empty folder. What a block prints becomes the ```text block behind it,
a figure that it draws is saved where an image behind it points to. The tests hold the text to be true.
"""

import contextlib
import io
import os
import re
import sys
import tempfile
from pathlib import Path

import matplotlib

TEXT = r"\n```text\n.*?^```\n"
IMAGE = r"\n!\[[^\]\n]*\]\([^)\n]*\)\n"
BLOCK = re.compile(
    rf"^```python\n(?P<code>.*?)^```\n(?:{TEXT})?(?P<images>(?:{IMAGE})*)", re.DOTALL | re.MULTILINE
)


def run(page: Path) -> None:
    """Run the blocks of a page and write what they print and draw."""
    from matplotlib import pyplot

    names: dict[str, object] = {"__name__": "__main__"}

    def shown(found: re.Match[str]) -> str:
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(found["code"], str(page), "exec"), names)
        images = re.findall(r"\(([^)]*)\)\n", found["images"])
        for number, name in zip(pyplot.get_fignums() if images else [], images, strict=True):
            pyplot.figure(number).savefig(page.parent / name, dpi=100)
        pyplot.close("all")
        lines = [line.rstrip() for line in printed.getvalue().rstrip().split("\n")]
        text = "\n```text\n" + "\n".join(lines) + "\n```\n" if lines != [""] else ""
        return f"```python\n{found['code']}```\n{text}{found['images']}"

    old = page.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        new = BLOCK.sub(shown, old)
    page.write_text(new, encoding="utf-8")


if __name__ == "__main__":
    matplotlib.use("Agg")
    os.environ["COLUMNS"] = "110"
    for argument in sys.argv[1:]:
        run(Path(argument).resolve())
