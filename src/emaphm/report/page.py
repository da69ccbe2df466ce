"""HTML pages from the templates in this folder."""

from typing import Any


def render(template: str, **values: Any) -> str:
    """Return the page of `template` with `values` inserted; their text is escaped."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("emaphm", "report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(values)
