"""Formulas of the pages as MathML, made when the site is built, so that a browser draws them without a script."""

import re

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer `mathml` of formulas."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _inline(page: HTML5Translator, node: nodes.math) -> None:
    page.body.append(_mathml(node.astext(), "inline"))
    raise nodes.SkipNode


def _block(page: HTML5Translator, node: nodes.math_block) -> None:
    page.body.append(page.starttag(node, "div", CLASS="math", STYLE="overflow: auto hidden; padding: 0.3em 0"))
    page.body.append(_mathml(node.astext(), "block") + "</div>\n")
    raise nodes.SkipNode


def _mathml(formula: str, display: str) -> str:
    """A formula as MathML, with a thin space on both sides of names of functions, as TeX has it."""
    spaced = r'<mo lspace="0.17em" rspace="0.17em">\1</mo>'
    return re.sub("<mi>([a-z]{2,})</mi>", spaced, convert(formula, display=display))
