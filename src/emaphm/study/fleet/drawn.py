"""Random diagnoses of synthetic units, drawn from covariances of computed diagnoses: cheap, for many units.

The second level of the study. Its diagnoses are not computed from recordings: each is the truth plus an error
drawn from the covariance that a diagnosis of a recording stated at nearby levels. It cannot evaluate
diagnoses, and assumes that their covariances are correct, which the first level verifies.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES, to_cartesian
from emaphm.arrays import Array
from emaphm.fleet.synthetic import FleetPlan, SyntheticUnit
from emaphm.fleet.synthetic.recordings import PART_NUMBER
from emaphm.prognosis import Evidence, Observation
from emaphm.prognosis.stress import StressPiece
from emaphm.random_streams import stream


@dataclass(frozen=True, eq=False)
class DiagnosisPool:
    """Results of diagnoses of recordings: levels (n, 8) and covariances (n, 8, 8) of `CARTESIAN_NAMES`."""

    level: Array
    covariance: Array

    @classmethod
    def of(cls, fleet: Sequence[Evidence]) -> "DiagnosisPool":
        """Return the pool of the diagnoses of a fleet that explain their recordings."""
        used = [diagnosis for evidence in fleet for diagnosis in evidence.used]
        levels = np.stack([diagnosis.level for diagnosis in used])
        return cls(levels, np.stack([diagnosis.covariance for diagnosis in used]))

    def near(self, level: Array) -> Array:
        """Return the covariance (8, 8) of the diagnosis nearest to `level` (8,)."""
        return np.asarray(self.covariance[np.sum((self.level - level) ** 2, axis=1).argmin()])


EXACT = DiagnosisPool(
    np.zeros((1, len(CARTESIAN_NAMES))), np.zeros((1, len(CARTESIAN_NAMES), len(CARTESIAN_NAMES)))
)
"""Diagnoses without error: the true levels."""


def drawn_evidence(unit: SyntheticUnit, plan: FleetPlan, pool: DiagnosisPool) -> Evidence:
    """Return diagnoses of a unit with random errors, one per check flight, and its recorded stress."""
    random = stream(plan.seed, "drawn diagnoses", unit.serial_number)
    observations, stresses = [], []
    for number, hours in enumerate(unit.check_flights(plan.interval), start=1):
        stress = unit.recorded_stress(number, plan.drawn_from.stress)
        stresses.append(StressPiece(float(hours - plan.interval), float(hours), stress))
        true = to_cartesian(unit.vectors[unit.row(hours)])
        covariance = pool.near(true)
        level = random.multivariate_normal(true, covariance, method="eigh")
        observations.append(Observation(float(hours), level, covariance, np.ones(level.size, bool)))
    return Evidence(
        unit.serial_number,
        PART_NUMBER,
        observations[-1].hours,
        tuple(observations),
        failures=() if unit.failure is None else (unit.failure,),
        stresses=tuple(stresses),
    )
