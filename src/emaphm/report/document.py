"""A document of headings, paragraphs, tables and figures, written as Markdown or as one HTML page."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from emaphm.plotting.svg import svg_uri
from emaphm.report.page import render
from emaphm.text_table import TextTable, markdown_table

SPECIAL = re.compile(r"([\\`*_{}\[\]<>|~$&#]|^[-+=])")
"""Characters that Markdown could interpret as markup: anywhere, or at the beginning of a line."""

NUMBERED = re.compile(r"^(\d+)([.)])(?=\s|$)")
"""Beginning of a line that Markdown would interpret as the number of a list item."""


@dataclass(frozen=True)
class Heading:
    """A heading of level 2 or 3."""

    level: int
    text: str


@dataclass(frozen=True)
class Paragraph:
    """A paragraph; a `warning` is emphasised."""

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
    """A figure as SVG; for Markdown, it is stored in the file `name`. `words` are its alternative text."""

    name: str
    words: str
    caption: str
    svg: bytes

    @property
    def uri(self) -> str:
        """The figure as a data URI."""
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
        """Return the document as Markdown, with links to the files of its figures."""
        parts = [f"# {escaped(self.title)}", escaped(self.subtitle), *map(_markdown, self.blocks)]
        return "\n\n".join(part for part in parts if part) + "\n"

    def to_html(self) -> str:
        """Return the document as one HTML page with embedded figures."""
        blocks = [(type(block).__name__, block) for block in self.blocks]
        return render("document.html.jinja", document=self, blocks=blocks)


def escaped(text: str) -> str:
    """Return `text` on one line, escaped so that Markdown shows it unchanged."""
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
