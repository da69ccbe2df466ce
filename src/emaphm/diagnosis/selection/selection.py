"""An estimate with the names of nuisances and laws that were selected for it."""

from dataclasses import dataclass, field, replace
from typing import Self

from emaphm.diagnosis.selection.first_look import FirstLook
from emaphm.estimation.search_result import SearchResult


@dataclass(frozen=True, eq=False)
class Selection:
    """The `result` of a selection, and the names of the selected `nuisances` and `laws`.

    `look` is the first look at further deviations.
    """

    result: SearchResult
    nuisances: tuple[str, ...] = ()
    laws: tuple[str, ...] = ()
    look: FirstLook = field(default_factory=FirstLook)

    def with_alternatives(self, alternatives: tuple[SearchResult, ...]) -> Self:
        """Return the selection with `alternatives` in place of those of its result."""
        return replace(self, result=replace(self.result, alternatives=alternatives))
