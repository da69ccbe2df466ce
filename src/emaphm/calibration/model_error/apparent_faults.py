"""Apparent faults: faults that a diagnosis finds in healthy recordings because of errors of the model."""

from collections.abc import Sequence

import numpy as np

from emaphm.actuator import NAMES, Actuator
from emaphm.actuator.faults import HEALTHY
from emaphm.actuator.unit.model_error import ApparentFaults
from emaphm.calibration.campaign import CampaignRow
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.errors import EmaphmError
from emaphm.quantiles import chi_squared_quantile

CHANCE = 0.2
"""Probability that standard errors alone cause apparent faults above the limit; as in
`emaphm.estimation.joint.random_effects`."""


def apparent_faults(
    units: Sequence[tuple[CampaignRow, Actuator]], max_corrections: int, seed: int, workers: int | None
) -> ApparentFaults | None:
    """Return the apparent faults of healthy rows, each with the unit as calibrated without that row.

    To save time, only the default nuisances are estimated, and no laws are tried. None if fewer than two rows
    can be diagnosed. A row cannot be diagnosed if it has no current or has parameters of its own, or if its
    simulation with that unit is not finite.
    """
    diagnoses = []
    for row, unit in units:
        try:
            diagnoses.append(
                diagnose(
                    row.completed(),
                    row.described(unit),
                    max_corrections=max_corrections,
                    nuisances=unit.nuisances.estimated,
                    seed=seed,
                    workers=workers,
                )
            )
        except EmaphmError:
            continue
    if len(diagnoses) < 2:
        return None
    sizes = {name: _excess(diagnoses, name) for name in NAMES if name in ApparentFaults.model_fields}
    return ApparentFaults(**sizes, recordings=len(diagnoses))


def _excess(diagnoses: Sequence[Diagnosis], name: str) -> float:
    """Return the rms deviation of a component from healthy, less the part that standard errors explain."""
    healthy = float(HEALTHY.vector[NAMES.index(name)])
    deviations = np.array([diagnosis.components[name].value - healthy for diagnosis in diagnoses])
    errors = np.array([diagnosis.components[name].standard_error for diagnosis in diagnoses])
    squares = float(np.sum((deviations / np.maximum(errors, 1e-9)) ** 2))
    if squares <= chi_squared_quantile(len(diagnoses), 1 - CHANCE):
        return 0.0
    return float(np.sqrt(max(float(np.mean(deviations**2 - errors**2)), 0.0)))
