"""Rendering of pages from the package's templates or a user's templates; inserted text is escaped."""

import logging
import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate
from emaphm.errors import ServerError, nearest
from emaphm.input_files import exists
from emaphm.prognosis.wording.sentences import hours_text
from emaphm.prognosis.wording.tables import value_and_interval
from emaphm.report.wording import LABELS
from emaphm.text_table import counted

if TYPE_CHECKING:
    from jinja2 import BaseLoader, Environment, TemplateError
    from starlette.requests import Request

NEVER = "no failure in sight"


LOG = logging.getLogger("emaphm.server")

ENDING = ".html.jinja"

OURS = "emaphm"
"""Prefix of the package's templates in a user's template: `{% extends "emaphm/unit.html.jinja" %}`."""


def render(template: str, request: "Request", **values: Any) -> bytes:
    """Return the rendered page of `template`; if a user's template fails, that of the package's template."""
    server = getattr(request.app.state, "server", None)
    values["has_door"] = server is not None and server.doorkeeper is not None
    folder = None if server is None else server.templates
    try:
        text = _environment(folder).get_template(template).render(values)
    except Exception as error:
        if folder is None:
            raise
        LOG.warning("%s: %s: %s; the page is shown as usual", folder, template, error)
        text = _environment(None).get_template(template).render(values)
    # A name may contain characters that cannot be encoded, which become question marks.
    return text.encode("utf-8", "replace")


def check_templates(folder: Path) -> None:
    """Refuse a folder with a template that has a syntax error, or whose name is not that of a page.

    Raises
    ------
    ServerError
        The message names the template, the line and the error.
    """
    from jinja2 import TemplateError

    if not exists(folder, ServerError) or not folder.is_dir():
        raise ServerError(f"--templates {folder}: no such folder")
    known = set(_environment(None).list_templates())
    try:
        names = sorted(path.name for path in folder.iterdir() if path.name.endswith(ENDING))
    except OSError as error:
        raise ServerError(
            f"--templates {folder}: cannot be read ({error.strerror}); let this user read the folder"
        ) from None
    if not names:
        raise ServerError(
            f"--templates {folder}: has no file that ends in {ENDING}; pages: {_page_names(known)}"
        )
    for name in names:
        if name not in known:
            raise ServerError(f"{folder / name}: no page has this name{nearest(name, sorted(known))}")
        try:
            _environment(folder).get_template(name)
        except (TemplateError, OSError, UnicodeDecodeError) as error:
            raise ServerError(
                f"{folder / name}{_line_of(error)}: {error}; correct it, or remove the file"
            ) from None


def _page_names(known: set[str]) -> str:
    return ", ".join(sorted(name for name in known if not name.startswith(f"{OURS}/")))


def _line_of(error: "TemplateError | OSError | UnicodeDecodeError") -> str:
    line = getattr(error, "lineno", None)
    return "" if line is None else f", line {line}"


@cache
def _environment(folder: Path | None) -> "Environment":
    """Return the sandboxed environment of templates; those in a user's `folder` have priority."""
    from jinja2 import ChoiceLoader, FileSystemLoader, PackageLoader, PrefixLoader, StrictUndefined
    from jinja2.sandbox import ImmutableSandboxedEnvironment

    package = PackageLoader("emaphm.server")
    loaders: list[BaseLoader] = [package, PrefixLoader({OURS: package})]
    environment = ImmutableSandboxedEnvironment(
        loader=ChoiceLoader(loaders if folder is None else [FileSystemLoader(folder), *loaders]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "hours": lambda value: "–" if value is None else f"{round(value, 2):,.12g}\u00a0h",  # as stated
        "about": lambda value: "–" if value is None else f"{value:,.0f}\u00a0h",  # as forecast
        "counted": counted,
        "rul": lambda value: NEVER if value is None else hours_text(value),
        "percent": lambda value: "–" if value is None else f"{100 * value:.1f} %",
        "label": lambda name: LABELS.get(name, name),
        "digits": lambda value: "–" if value is None else f"{value:.4g}",
        "value_and_interval": value_and_interval,
        "with_error": lambda values: str(NuisanceEstimate(**values)),
        "slug": lambda text: (text or "none").replace(" ", "-"),
        "kind": lambda name: name.replace("_", " ").replace("rul", "RUL"),
        "file": lambda name: re.split(r"[/\\]", name)[-1] or name,
        "day": lambda text: text[:10],
        "moment": lambda text: text[:16].replace("T", " "),
    }
    return environment
