"""The gallery as a page: runs examples/gallery/*.py and writes docs/gallery.md.

Usage: python benches/gallery.py
"""

import re
import runpy
from pathlib import Path

ROOT = Path(__file__).parents[1]
SCRIPTS = sorted((ROOT / "examples" / "gallery").glob("*.py"))
HEAD = """
This page simulates sixteen kinds of nonlinear equations, fits them and compares the estimates with the true
values. Each script in `examples/gallery` has at most forty lines; `tests/python/docs/test_gallery.py` runs
all of them. The noise is white; nsr is its standard deviation divided by the rms of the noise-free outputs.
Each section shows the equation and the results. The rest of a script is
`mf.simulate(equation.model(truth), ...)` and `mf.fit(rec, equation)`. `python benches/gallery.py` writes this
page.
"""
ROW = "| `{}` | {:g} | {:.4g} ± {:.2g} | {:+.1f} |"


def equation(text):
    """The lines of a script that make its Equation."""
    return re.search(r"^\w+ = mf\.Equation\(.*?^(?=truth)", text, re.DOTALL | re.MULTILINE)[0].strip()


def main():
    """Write the page."""
    parts = ["# Sixteen equations\n\n", " ".join(HEAD.split()), "\n"]
    for script in SCRIPTS:
        text = script.read_text(encoding="utf-8")
        title, story = text.split('"""')[1].split("\n\n", 1)
        title = title.strip().rstrip(".").replace("\n", " ")
        names = runpy.run_path(str(script))
        fit, truth, rec = names["fit"], names["truth"], names["rec"]
        nsr = re.search(r"nsr=([\d.]+)", text)[1]
        rows = [
            ROW.format(name, truth[name], value, error, (value - truth[name]) / error)
            for name, value, error in zip(fit.param_names, fit.params, fit.bse, strict=True)
        ]
        score = ", ".join(f"{level:.0f}" for level in fit.score()["signal_to_error"])
        parts.append(
            f"\n## {title}\n\n`examples/gallery/{script.name}`. {' '.join(story.split())}\n\n"
            f"```python\nimport modfun as mf\n\n{equation(text)}\n```\n\n"
            f"{rec.intervals + 1} samples over {rec.duration:g} s, nsr {nsr}; harmonics up to "
            f"{fit.band[1]:.3g} rad/s; signal-to-error ratio {score} dB.\n\n"
            "| parameter | true value | estimate ± se | difference / se |\n|---|---|---|---|\n"
            + "\n".join(rows)
            + "\n"
        )
    (ROOT / "docs" / "gallery.md").write_text("".join(parts), encoding="utf-8")


if __name__ == "__main__":
    main()
