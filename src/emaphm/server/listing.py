"""Lists in parts: which entries a page shows, and how that is said."""

from dataclasses import dataclass, replace
from typing import Self


@dataclass(frozen=True)
class Listing:
    """What page `number`, from 1 on, shows of a list of `total` entries, `size` a page, the newest first."""

    number: int
    size: int
    total: int

    @classmethod
    def of(cls, number: int, size: int, total: int) -> Self:
        """Return page `number`, or the last one where entries have gone since its link was made."""
        asked = cls(number, size, total)
        return replace(asked, number=min(number, asked.pages))

    @property
    def pages(self) -> int:
        """How many pages there are."""
        return max(-(-self.total // self.size), 1)

    @property
    def start(self) -> int:
        """How many entries stand on the pages before."""
        return (self.number - 1) * self.size

    def caption(self, noun: str) -> str:
        """Return how many of how many are shown; `noun` is what one is called."""
        every = counted(self.total, noun)
        if self.pages == 1:
            return f"{every}."
        if self.number == 1:
            return f"The newest {self.size} of {every}."
        end = min(self.start + self.size, self.total)
        return f"{self.start + 1} to {end} of {every}, counted from the newest."


def counted(count: int, one: str, many: str = "") -> str:
    """Return a number with what it counts: `one`, or `many`, which has an s more where left out."""
    return f"{count} {one if count == 1 else many or f'{one}s'}"
