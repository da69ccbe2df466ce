"""Error, coverage, detection and false alarms of the diagnosis at each setting of a rig."""

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
    """Rates of one rig and method: errors in percent, the others as shares.

    Coverage is over the random faults; detection and false alarms are over the components of recordings with
    small single faults and of healthy recordings. `cases` is the number of recordings with random faults.
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
        """Return the rates of a page's row; `StudyError` if it lacks finished trials of a kind."""
        trials = runs.filter(pl.col("rig") == row.rig, pl.col("method") == row.method)
        random, small, healthy = (
            trials.filter(pl.col("case_kind") == kind) for kind in ("random", "small", "healthy")
        )
        for kind, rows in (("random", random), ("small", small), ("healthy", healthy)):
            if rows.is_empty():
                raise StudyError(f"no run of '{row.rig}' with {kind} cases is finished; continue the study")
        percents, shares = errors(random), coverage(random)
        return cls(
            float(np.median(percents)),
            float(np.percentile(percents, 95)),
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
        """Whether intervals miss the truth more often than by chance, although most fits are explained."""
        return self.explained > 0.5 and self.least_coverage < least_by_chance(self.cases)
