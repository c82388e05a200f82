"""How Sphinx makes the site: `make docs` writes it to out/site, without network; warnings are errors."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(Path(__file__).parent / "extensions"))

project = "interdrive"
author = "the interdrive maintainers"
copyright = "2026, the interdrive maintainers"  # noqa: A001 - the name is Sphinx's
release = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]["package"]["version"]
version = release

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "generated_pages", "executed_pages", "ages"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["extensions", "figures", "reference/generated"]
default_role = "code"  # `x` in docstrings
nitpicky = False
suppress_warnings = ["toc.not_included"]  # a new page is found by search before it has its place

html_theme = "furo"
html_title = f"interdrive {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
templates_path: list[str] = []

myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence", "deflist"]
# Indented blocks are commands or Python; neither is worth a guess.
highlight_language = "none"

autodoc_member_order = "bysource"
autoclass_content = "both"  # what `__init__` says, too
autodoc_mock_imports = ["stable_baselines3", "pufferlib"]
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_class_signature = "mixed"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_attr_annotations = True
add_module_names = False
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88
