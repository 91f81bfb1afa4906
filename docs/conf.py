"""The documentation site: `make docs` builds it into target/docs, without the network."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import alsph
from alsph.cases.method import Method
from alsph.parameters import Parameters

project = "alsph"
author = "The alsph developers"
version = release = alsph.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_design",
    "commands",
    "mathml",
]
sys.path.append(str(Path(__file__).parent / "_extensions"))
exclude_patterns = ["_templates", "_extensions"]
templates_path = ["_templates"]

html_theme = "pydata_sphinx_theme"
html_title = "alsph"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_theme_options = {
    "navbar_align": "left",
    "header_links_before_dropdown": 7,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "show_toc_level": 2,
    "footer_start": ["copyright"],
    "footer_end": [],
}
html_sidebars = {page: [] for page in ("gallery", "command_line", "equations")}  # they have no pages below them
copyright = "The alsph developers, MIT licence"

# Markdown. Anchors are GitHub's, so that links work on both.
myst_enable_extensions = ["colon_fence", "dollarmath"]
html_math_renderer = "mathml"  # browsers draw it, no script from elsewhere
myst_heading_anchors = 4
myst_footnote_transition = False
highlight_language = "none"

# Tutorials are run at each build, in a folder of their own.
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_timeout = 120
nb_execution_raise_on_error = True
nb_merge_streams = True

# Docstrings.
autosummary_ignore_module_all = False
autodoc_member_order = "bysource"
autodoc_default_options = {"exclude-members": "model_config"}  # pydantic's
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
napoleon_numpy_docstring = True
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_param = False  # types are words, no links

# Names within alsph must lead somewhere; those of numpy, pathlib, ... would need the network.
nitpicky = True
nitpick_ignore_regex = [(r"py:.*", r"(?!alsph\b).*")]
nitpick_ignore = [("py:class", "alsph.config.Made")]  # a type variable

PIPE = re.compile(r"``.*?``|\|")
"""A literal, or a bar outside of literals."""

FILES = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
"""Files above docs/ that are pages of the site, by their names there."""


def _links_to_files_above(app: Any, name: str, content: list[str]) -> None:
    """Lead links such as ``../CONTRIBUTING.md#performance``, which are GitHub's, to the page of the site."""
    for file, page in FILES.items():
        content[0] = content[0].replace(f"](../{file}", f"](/{page}")


def _entries(lines: list[str]) -> Iterator[tuple[str, str]]:
    """Pairs of lines of the parameters in the docstring of a case: name with default, and description."""
    start = lines.index("Parameters") + 2
    return zip(lines[start::2], lines[start + 1 :: 2], strict=False)


def _own_parameters(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Leave out of a case what all cases have from :class:`Method`, but for other defaults."""
    if what != "class" or not issubclass(obj, Method) or obj is Method or "Parameters" not in lines:
        return
    shared = set(_entries((Method.__doc__ or "").splitlines()))
    own = [line for entry in _entries(lines) if entry not in shared for line in entry]
    more = "Besides those of the numerical method, which all cases share: :class:`~alsph.cases.method.Method`."
    lines[lines.index("Parameters") :] = ["Parameters", "----------", *own, "", "Notes", "-----", more]


def _bars(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Take the bars of |∇·u| as they stand; reStructuredText has them for substitutions."""
    lines[:] = [PIPE.sub(lambda found: found[0] if found[0] != "|" else r"\|", line) for line in lines]


ATTRIBUTES: dict[str, list[str]] = {}
"""What stands below attributes, by their names, while napoleon takes what stands before its first colon for a type."""


def _keep(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    if what in ("attribute", "data", "property"):
        ATTRIBUTES[name] = list(lines)


def _restore(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    lines[:] = ATTRIBUTES.pop(name, lines)


def _by_name(app: Any, what: str, name: str, obj: Any, options: Any, *signature: Any) -> tuple[str, None] | None:
    """Parameters are given by name; which there are stands below, not in the signature of pydantic."""
    return ("(**parameters)", None) if what == "class" and issubclass(obj, Parameters) else None


PUBLIC = [getattr(alsph, name) for name in alsph.__all__]


def _not_twice(app: Any, what: str, name: str, obj: Any, skip: bool, options: Any) -> bool | None:
    """Leave out of the pages of modules what has a page as ``alsph.NAME``."""
    return True if what == "module" and any(obj is public for public in PUBLIC) else None


def setup(app: Any) -> None:
    """Connect what is above to Sphinx."""
    app.connect("autodoc-process-signature", _by_name)
    app.connect("autodoc-skip-member", _not_twice)
    app.connect("source-read", _links_to_files_above)
    app.connect("autodoc-process-docstring", _own_parameters, priority=300)  # both before napoleon
    app.connect("autodoc-process-docstring", _bars, priority=400)
    app.connect("autodoc-process-docstring", _keep, priority=450)
    app.connect("autodoc-process-docstring", _restore, priority=600)  # after it
