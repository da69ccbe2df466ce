"""The faults that a diagnosis would find in healthy recordings: errors of the model that look like faults."""

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
"""Probability with which standard errors alone make as large apparent faults as are taken for errors of the
model; as in `emaphm.estimation.joint.random_effects`."""


def apparent_faults(
    units: Sequence[tuple[CampaignRow, Actuator]], max_corrections: int, seed: int, workers: int | None
) -> ApparentFaults | None:
    """Return the apparent faults of healthy rows, each with the unit as calibrated without it.

    Only what is estimated by default is, for time: no further nuisance or law is tried. None where fewer than
    two can be diagnosed: a recording without a current, with parameters of its own, or of which the unit
    without it makes no finite simulation, cannot.
    """
    found = []
    for row, unit in units:
        try:
            found.append(
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
    if len(found) < 2:
        return None
    sizes = {name: _excess(found, name) for name in NAMES if name in ApparentFaults.model_fields}
    return ApparentFaults(**sizes, recordings=len(found))


def _excess(found: Sequence[Diagnosis], name: str) -> float:
    """Return the rms of what a component deviates from healthy by, less what its standard errors explain."""
    healthy = float(HEALTHY.vector[NAMES.index(name)])
    away = np.array([one.components[name].value - healthy for one in found])
    errors = np.array([one.components[name].standard_error for one in found])
    if float(np.sum((away / np.maximum(errors, 1e-9)) ** 2)) <= chi_squared_quantile(len(found), 1 - CHANCE):
        return 0.0
    return float(np.sqrt(max(float(np.mean(away**2 - errors**2)), 0.0)))
