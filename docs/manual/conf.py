"""Configuration of Sphinx for the manual (``python -m docs.manual``)."""

from __future__ import annotations

from wingfit.service.version import wingfit_version

project = "wingfit"
author = "the authors of wingfit"
release = version = wingfit_version()
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "docs.manual.additions",
]
root_doc = "index"
exclude_patterns = ["docs/manual/**"]
nitpicky = False
# The example of a wire format is shortened with "...", which no lexer of its language accepts.
suppress_warnings = ["misc.highlighting_failure"]
highlight_language = "text"
default_role = "literal"
smartquotes = False  # a prime is a time derivative

myst_heading_anchors = 6  # the anchors that code hosts make of headings

autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_rtype = False

html_theme = "furo"
html_title = "wingfit"
templates_path = ["templates"]
html_static_path = ["static"]
html_use_index = False
html_css_files = ["manual.css"]
html_js_files = ["manual.js"]
html_copy_source = False
html_show_sourcelink = False
html_show_copyright = False
html_last_updated_fmt = None
pygments_dark_style = "a11y-dark"
