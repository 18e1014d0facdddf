"""The documentation site: `make docs`. How pages are written is told in CONTRIBUTING.md."""

import sys
from pathlib import Path

import modfun

sys.path.insert(0, str(Path(__file__).parent / "_extensions"))

project = "modfun"
author = "The modfun authors"
copyright = author
version = release = modfun.__version__

extensions = [
    "myst_nb",
    "numpydoc",
    "pages",
    "formulas",
    "commands",
    "links",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "sphinx_design",
]
exclude_patterns = ["_build", "_extensions", "_templates", "requirements.txt"]
templates_path = ["_templates"]

# Pages whose ```python blocks are run while the site is built, and what they print and draw is shown.
executed_pages = ["index", "tour", "howto/*", "explanation/*"]
# Pages whose links to other pages are the order of their section.
section_pages = [
    "start",
    "guides",
    "examples",
    "evidence",
    "development",
    "records/README",
    "howto/README",
    "explanation/README",
]
# Executed pages that are offered as notebooks, too.
notebooks = [
    "tour",
    "howto/write_equation",
    "howto/several_manoeuvres",
    "howto/add_estimator",
    "explanation/method",
]

myst_enable_extensions = ["colon_fence", "dollarmath", "amsmath"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4  # links to headings are the same on a code host
nb_execution_mode = "force"
nb_execution_in_temp = True  # what a page writes is gone with the build
nb_execution_raise_on_error = True
nb_execution_timeout = 120
nb_merge_streams = True

# The types are told by the docstrings, in words; annotations would repeat them.
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autosummary_generate = True
# Functions of the same letters have pages, too: files that differ on every file system.
autosummary_filename_map = {
    f"modfun.{name}": f"modfun.{name}-class" for name in ("Collinearity", "Fit", "Sinusoids")
}
smartquotes = False  # options start with two hyphens
default_role = "code"  # `words` of docstrings
numpydoc_class_members_toctree = False
numpydoc_show_class_members = False  # the template lists them

html_math_renderer = "drawn"
html_theme = "pydata_sphinx_theme"
html_title = "modfun"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "header_links_before_dropdown": 8,
}
html_sidebars = {"index": []}
