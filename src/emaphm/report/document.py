"""A document of headings, paragraphs, tables and figures, written as Markdown or as one HTML page."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from emaphm.plotting.svg import svg_uri
from emaphm.report.page import render
from emaphm.text_table import TextTable, markdown_table

SPECIAL = re.compile(r"([\\`*_{}\[\]<>|~$&#]|^[-+=])")
"""What Markdown could take for markup: anywhere, or at the beginning of a line."""

NUMBERED = re.compile(r"^(\d+)([.)])(?=\s|$)")
"""A beginning that Markdown would take for an item's number."""


@dataclass(frozen=True)
class Heading:
    """A heading of level 2 or 3."""

    level: int
    text: str


@dataclass(frozen=True)
class Paragraph:
    """A paragraph; a `warning` is set off from the others."""

    text: str
    warning: bool = False


@dataclass(frozen=True)
class Items:
    """A list of points."""

    texts: tuple[str, ...]


@dataclass(frozen=True)
class Facts:
    """Names and values."""

    values: Mapping[str, str]


@dataclass(frozen=True)
class Picture:
    """A figure as SVG, kept in the file `name` next to the Markdown; `words` describe it."""

    name: str
    words: str
    caption: str
    svg: bytes

    @property
    def uri(self) -> str:
        """The figure as the address of an image."""
        return svg_uri(self.svg)


Block = Heading | Paragraph | Items | Facts | Picture | TextTable


@dataclass(frozen=True)
class Document:
    """A titled sequence of blocks."""

    title: str
    subtitle: str
    blocks: tuple[Block, ...]

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """The figures, in order."""
        return tuple(block for block in self.blocks if isinstance(block, Picture))

    def to_markdown(self) -> str:
        """Return the document as Markdown, its figures as links to their files."""
        parts = [f"# {escaped(self.title)}", escaped(self.subtitle), *map(_markdown, self.blocks)]
        return "\n\n".join(part for part in parts if part) + "\n"

    def to_html(self) -> str:
        """Return the document as one HTML page with its figures inside."""
        blocks = [(type(block).__name__, block) for block in self.blocks]
        return render("document.html.jinja", document=self, blocks=blocks)


def escaped(text: str) -> str:
    """Return `text` on one line, as Markdown that shows it as it is."""
    marked = SPECIAL.sub(r"\\\1", " ".join(text.split()))
    return NUMBERED.sub(r"\1\\\2", marked)


def _markdown(block: Block) -> str:
    match block:
        case Heading():
            return f"{'#' * block.level} {escaped(block.text)}"
        case Paragraph():
            return f"> **{escaped(block.text)}**" if block.warning else escaped(block.text)
        case Items():
            return "\n".join(f"- {escaped(text)}" for text in block.texts)
        case Facts():
            return "\n".join(f"- {escaped(name)}: {escaped(value)}" for name, value in block.values.items())
        case Picture():
            return f"![{escaped(block.words)}](figures/{block.name})\n\n*{escaped(block.caption)}*"
        case TextTable():
            escaped_rows = [map(escaped, row) for row in block.rows]
            return markdown_table([*map(escaped, block.header)], [[*row] for row in escaped_rows])
