"""Accuracy of the diagnoses of a synthetic fleet, which are the basis of its predictions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.actuator.faults import to_cartesian
from emaphm.fleet.synthetic import SyntheticUnit
from emaphm.prognosis import Evidence


@dataclass(frozen=True)
class Quality:
    """Accuracy of the diagnoses of a fleet, over all components.

    Attributes
    ----------
    recordings
        Number of recordings.
    explained
        Share of explained recordings; error and coverage are over these recordings.
    error
        Root mean square of estimate minus truth [-].
    coverage
        Share of the estimates within two standard errors of the truth; 95 % for correct standard errors.
    """

    recordings: int
    explained: float
    error: float
    coverage: float


def quality(fleet: Sequence[tuple[SyntheticUnit, Evidence]]) -> Quality:
    """Return the accuracy of the diagnoses of synthetic units, compared with their true levels."""
    errors, deviations = [], []
    for unit, evidence in fleet:
        for diagnosis in evidence.used:
            errors.append(diagnosis.level - to_cartesian(unit.vectors[unit.row(diagnosis.hours)]))
            deviations.append(np.sqrt(np.diag(diagnosis.covariance)))
    error, deviation = np.array(errors), np.array(deviations)
    recordings = sum(len(evidence.observations) for _, evidence in fleet)
    return Quality(
        recordings=recordings,
        explained=len(errors) / recordings,
        error=float(np.sqrt(np.mean(error**2))),
        coverage=float(np.mean(np.abs(error) <= 2 * deviation)),
    )
