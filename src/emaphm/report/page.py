"""HTML pages from the templates beside this file."""

from typing import Any


def render(template: str, **values: Any) -> str:
    """Return the page of `template` with `values` put in; whatever is text in them shows as it is."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("emaphm", "report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(values)
