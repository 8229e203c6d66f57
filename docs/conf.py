"""Settings of Sphinx. `make docs` builds the pages into docs/_build/html; what is generated is in _extensions."""

import sys
from importlib.metadata import version as installed
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_extensions"))

project = "lidarcore"
author = "the lidarcore authors"
release = version = installed("lidarcore")
html_title = f"lidarcore {release}"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "docstrings",
    "python_reference",
    "rest_reference",
    "command_line_reference",
    "settings_reference",
    "formats_reference",
]
exclude_patterns = ["_build", "guide"]  # the guide is made by `make guide`, as one page of its own
default_role = "py:obj"  # `Scan` in a docstring becomes a link

myst_enable_extensions = ["colon_fence", "deflist", "attrs_block"]
myst_heading_anchors = 4

add_module_names = False
toc_object_entries_show_parents = "hide"
smartquotes = False
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
python_maximum_signature_line_length = 88

html_theme = "furo"
templates_path = ["_templates"]
html_static_path = ["_static", "../static/vendor/ibm-plex-sans", "../static/icon.svg"]
html_extra_path = ["../static/guide.html"]
html_favicon = "../static/icon.svg"
html_css_files = ["style.css"]
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
html_domain_indices = False  # its page would need a script within the page
_fonts = {
    "font-stack": '"Plex", system-ui, sans-serif',
    "font-stack--monospace": "ui-monospace, SFMono-Regular, Menlo, Consolas, monospace",
}
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#1a62d6", "color-brand-content": "#1a62d6", **_fonts},
    "dark_css_variables": {"color-brand-primary": "#86b7ff", "color-brand-content": "#86b7ff", **_fonts},
}
