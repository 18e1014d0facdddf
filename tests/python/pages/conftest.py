"""Pages whose drawings are not looked at."""

import pytest
from matplotlib.figure import Figure


@pytest.fixture
def undrawn(monkeypatch):
    """Figures are made but not written as SVG, which is most of the time of a page."""
    monkeypatch.setattr(Figure, "savefig", lambda self, file, **options: file.write("<svg></svg>"))
