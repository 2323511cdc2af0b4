"""The site of these pages, built by `make docs` without a network: pages, reference made from the code, and examples
that are run."""

import logging
import re
import shutil
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
import reference
from pygments.lexers.special import TextLexer
from sphinx.highlighting import lexers

project, author, version = "touchcal", "the authors of touchcal", "0.1.0"
copyright = "2026 the authors of touchcal, MIT licence"
root_doc = "site"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "numpydoc", "sphinx_gallery.gen_gallery",
              "sphinx_copybutton", "mathml"]
exclude_patterns = ["index.md", "conf.py", "reference.py", "mathml.py", "**/README*"]
html_theme, html_title = "furo", "touchcal"
html_math_renderer = "mathml"
html_static_path, html_css_files = ["static"], ["site.css"]
html_extra_path = ["index.html"]  # leads to the first page, whose name is that of its source
smartquotes = False  # they would make one dash of the two of an option
html_theme_options = {"navigation_with_keys": True}

myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 4
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
default_role = "code"  # names in docstrings stand between single backticks
autosummary_generate = True

sphinx_gallery_conf = {
    "examples_dirs": ["tutorials", "gallery"],
    "gallery_dirs": ["made/tutorials", "made/gallery"],
    "filename_pattern": r"\.py$",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_memory": False,
    "write_computation_times": False,  # their page would load scripts from elsewhere
    "capture_repr": (),
    "show_signature": False,
    "image_srcset": ["2x"],
}

for _name in ("skfem", "arviz.preview"):
    logging.getLogger(_name).setLevel(logging.WARNING)
lexers["mermaid"] = TextLexer()

_ROOT = Path(__file__).parents[1]


def setup(app) -> None:
    """Write what the site has and the folder has not, before the sources are read."""
    made = Path(app.srcdir) / "made"
    reference.write(made / "reference")
    for name in ("CONTRIBUTING.md", "CHANGELOG.md"):
        text = (_ROOT / name).read_text(encoding="utf-8")
        (made / name.lower()).write_text(text.replace("](docs/", "](../"), encoding="utf-8")
    app.connect("source-read", _to_made_examples)
    app.connect("build-finished", _with_press)


def _to_made_examples(app, page: str, source: list[str]) -> None:
    """Links to examples, in place, as links to the pages that are made of them."""
    source[0] = re.sub(r"\]\(\.\./((?:tutorials|gallery)/[\w/]+)\.py\)", r"](../made/\1.rst)", source[0])


def _with_press(app, error: Exception | None) -> None:
    """The page to press, which a tutorial writes, next to the first page, which shows it."""
    if error is None and app.builder.format == "html":
        shutil.copy(Path(app.srcdir) / "tutorials" / "press.html", app.outdir)
