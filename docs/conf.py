"""How the documentation is built: `make docs`."""

import logging
import os
import re
import shutil
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "site"))
os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
os.environ["MPLBACKEND"] = "agg"
logging.getLogger("alembic").setLevel(logging.WARNING)

from examples import write_examples  # noqa: E402 - in the folder that was just added
from figures import scrape  # noqa: E402
from reference import write_python_names, write_toml_keys  # noqa: E402
from sphinx.application import Sphinx  # noqa: E402

from emaphm.version import VERSION  # noqa: E402

project = "emaphm"
version = release = VERSION
copyright = "the authors of emaphm, Apache-2.0"  # noqa: A001 - Sphinx's name

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
    "cyclopts.ext.sphinx",
    "executed",
]
exclude_patterns = ["_build", "site", "comparison/tables", "tutorials"]
html_theme = "furo"
html_title = f"emaphm {VERSION}"
html_static_path = ["site/static"]
html_css_files = ["wide.css"]
myst_heading_anchors = 3
myst_enable_extensions = ["attrs_inline"]
autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
suppress_warnings = ["config.cache"]

BUILT = HERE / "_build"
example_files = str(BUILT / "example_files")
example_folders = str(BUILT / "examples")

sphinx_gallery_conf = {
    "examples_dirs": ["tutorials"],
    "gallery_dirs": ["_tutorials"],
    "filename_pattern": r"\.py$",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "image_scrapers": [scrape],
    "show_memory": False,
    "min_reported_time": 1e9,
    "remove_config_comments": True,
}


def _prepare(_: Sphinx) -> None:
    """Make the files that examples use, and the pages that come from the program."""
    files = Path(example_files)
    shutil.rmtree(BUILT / "examples", ignore_errors=True)
    if not files.is_dir():
        write_examples(files)
    pages = HERE / "reference" / "generated"
    pages.mkdir(exist_ok=True)
    write_python_names(pages / "python.md")
    contributing = (HERE.parent / "CONTRIBUTING.md").read_text(encoding="utf-8")
    (pages / "contributing.md").write_text(contributing.replace("](docs/", "](../../"), encoding="utf-8")
    for name in ("reprise", "xjtu"):
        # Their commands need measured data, which a build may not have.
        text = (HERE.parent / "examples" / name / "README.md").read_text(encoding="utf-8")
        text = text.replace("```console", "```text").replace("](../../docs/", "](../../")
        (pages / f"{name}.md").write_text(text, encoding="utf-8")
    write_toml_keys(pages / "toml_keys.md")


def _outside(_: Sphinx, __: str, text: list[str]) -> None:
    """Turn links to files above the documentation, which a forge follows, into links to their pages here."""
    text[0] = text[0].replace("](../CONTRIBUTING.md", "](reference/generated/contributing.md")
    text[0] = re.sub(r"\]\(\.\./examples/(\w+)/README\.md", r"](reference/generated/\1.md", text[0])


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    app.connect("builder-inited", _prepare, priority=100)
    app.connect("source-read", _outside)
    return {"version": "1"}
