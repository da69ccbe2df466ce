"""The map of the limits: what becomes of the diagnosis at each setting of a rig."""

from dataclasses import dataclass
from typing import Self

import numpy as np
import polars as pl

from emaphm.actuator import NAMES
from emaphm.errors import StudyError
from emaphm.study.analysis.rates import (
    coverage,
    detection,
    errors,
    explained,
    false_alarms,
    least_by_chance,
)
from emaphm.study.plan import PageRow


@dataclass(frozen=True)
class SettingRates:
    """What the trials of one rig and method come to: errors in percent, the rest as shares.

    Coverage is over the random faults; detection and false alarms over small single faults and healthy
    recordings, of components. `cases` counts the random ones.
    """

    median: float
    p95: float
    mean_coverage: float
    least_coverage: float
    least_covered: str
    explained: float
    detection: float
    false_alarms: float
    cases: int

    @classmethod
    def of(cls, row: PageRow, runs: pl.DataFrame) -> Self:
        """Return the rates of a page's row; `StudyError` where it lacks finished trials of a kind."""
        mine = runs.filter(pl.col("rig") == row.rig, pl.col("method") == row.method)
        random, small, healthy = (
            mine.filter(pl.col("case_kind") == kind) for kind in ("random", "small", "healthy")
        )
        for kind, rows in (("random", random), ("small", small), ("healthy", healthy)):
            if rows.is_empty():
                raise StudyError(f"no run of '{row.rig}' with {kind} cases is finished; go on with the study")
        found, shares = errors(random), coverage(random)
        return cls(
            float(np.median(found)),
            float(np.percentile(found, 95)),
            float(shares.mean()),
            float(shares.min()),
            NAMES[int(shares.argmin())],
            explained(random),
            detection(small),
            false_alarms(pl.concat([small, healthy])),
            random.height,
        )

    @property
    def overconfident(self) -> bool:
        """Whether intervals miss the truth more often than chance lets them, most fits being explained."""
        return self.explained > 0.5 and self.least_coverage < least_by_chance(self.cases)
