"""Takes the figures of a tutorial: those that a block calls `figure`, which belong to no window."""

from typing import Any

from sphinx_gallery.scrapers import figure_rst


def scrape(_: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Save the figure of a block where it has one, and return what shows it."""
    figure = block_vars["example_globals"].pop("figure", None)
    if figure is None:
        return ""
    path = next(block_vars["image_path_iterator"])
    figure.savefig(path, dpi=120)
    return str(figure_rst([path], gallery_conf["src_dir"]))
