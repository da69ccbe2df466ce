"""How good the diagnoses of a synthetic fleet are, on which its predictions stand."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.actuator.faults import to_cartesian
from emaphm.fleet.synthetic import SyntheticUnit
from emaphm.prognosis import Evidence


@dataclass(frozen=True)
class Quality:
    """Of the diagnoses of a fleet, all components together.

    Attributes
    ----------
    recordings
        Number of them.
    explained
        Share that the model explains; the others do not count in what follows.
    error
        Root mean square of estimate less truth [-].
    coverage
        Share of the estimates within two standard errors of the truth; 95 % if these are right.
    """

    recordings: int
    explained: float
    error: float
    coverage: float


def quality(fleet: Sequence[tuple[SyntheticUnit, Evidence]]) -> Quality:
    """Return how good the diagnoses of synthetic units are, against their true levels."""
    errors, deviations = [], []
    for unit, evidence in fleet:
        for one in evidence.used:
            errors.append(one.level - to_cartesian(unit.vectors[unit.row(one.hours)]))
            deviations.append(np.sqrt(np.diag(one.covariance)))
    error, deviation = np.array(errors), np.array(deviations)
    recordings = sum(len(evidence.observations) for _, evidence in fleet)
    return Quality(
        recordings=recordings,
        explained=len(errors) / recordings,
        error=float(np.sqrt(np.mean(error**2))),
        coverage=float(np.mean(np.abs(error) <= 2 * deviation)),
    )
