"""Pages of long lists: the entries on a page, and its caption."""

from dataclasses import dataclass, replace
from typing import Self

from emaphm.text_table import counted


@dataclass(frozen=True)
class Listing:
    """Page `number`, counted from 1, of a list of `total` entries with `size` per page, the newest first."""

    number: int
    size: int
    total: int

    @classmethod
    def of(cls, number: int, size: int, total: int) -> Self:
        """Return page `number`, or the last page if the list has become shorter since the link was made."""
        page = cls(number, size, total)
        return replace(page, number=min(number, page.pages))

    @property
    def pages(self) -> int:
        """Number of pages."""
        return max(-(-self.total // self.size), 1)

    @property
    def start(self) -> int:
        """Number of entries on the previous pages."""
        return (self.number - 1) * self.size

    def caption(self, noun: str) -> str:
        """Return the numbers of displayed and of all entries, with `noun` as the name of an entry."""
        total = counted(self.total, noun)
        if self.pages == 1:
            return f"{total}."
        if self.number == 1:
            return f"The newest {self.size} of {total}."
        end = min(self.start + self.size, self.total)
        return f"{self.start + 1} to {end} of {total}, counted from the newest."
