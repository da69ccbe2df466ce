"""Starts of a compliant shaft's stiffness and damping: by the reference model, on a grid.

The averaged model shows a swing of some kilohertz wrongly, if at all, so that its best fit leads astray: a
shaft of 985 N·m/rad was taken for one of 713, with three times its damping. The reference model with all else
as of a stiff shaft shows both to a factor of two, and the correction of the bias goes on from there.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.actuator.lumped_parameters import lumped_parameters
from emaphm.arrays import Array
from emaphm.calibration.campaign import CampaignRow
from emaphm.calibration.conditions import joint_objective
from emaphm.calibration.description import Description
from emaphm.calibration.held_out import subset
from emaphm.calibration.unit_fit import FitSettings, SearchedUnit, fitted_parameters, searched
from emaphm.errors import MethodError
from emaphm.estimation.discrepancy import has_reference
from emaphm.estimation.joint.correction import compared
from emaphm.estimation.joint.objective import JointObjective
from emaphm.estimation.parameter_variation import ParameterVariation

NAMES = ("stiffness", "damping")


@dataclass(frozen=True)
class ShaftScanSettings:
    """Where a shaft is looked for; `emaphm study run limits` (compliant shafts, calibrated) shows the result.

    Stiffnesses are `stiffness_factors` times that of the description or law, dampings `damping_ratios` of the
    critical; about the best, once more by `finer` factors of both. `starts` of the best are corrected. The
    `recordings` shortest ones are compared: a reference run takes a twentieth of a recording's time.
    """

    stiffness_factors: tuple[float, ...] = tuple(2.0**i for i in range(-3, 6))
    damping_ratios: tuple[float, ...] = (0.01, 0.05, 0.2, 0.5)
    finer: tuple[float, ...] = (0.7, 1.0, 1.4)
    starts: int = 2
    recordings: int = 3


SCAN = ShaftScanSettings()


def shaft_starts(
    rows: Sequence[CampaignRow], description: Description, settings: FitSettings
) -> tuple[SearchedUnit, ...]:
    """Return where fits of a description with a free shaft should start; nothing for any other.

    Nor where the reference model cannot run, or is not to be asked.
    """
    actuator = description.actuator
    fitted = fitted_parameters(rows, actuator, description.free)
    if actuator.transmission is None or not set(NAMES) <= set(fitted) or not settings.max_corrections:
        return ()
    unit = ParameterVariation.free(actuator, fitted)
    joint = joint_objective(rows, actuator, unit, settings.nuisances, settings.workers)
    if not all(has_reference(term.objective.problem) for term in joint.terms):
        return ()
    stiff = actuator.model_copy(update={"transmission": None})
    others = tuple(name for name in fitted if name not in NAMES)
    start = {name: value for name, value in description.start.items() if name in others}
    found = searched(rows, stiff, others, settings, start)
    point = np.zeros(joint.box.lower.size)
    point[[fitted.index(name) for name in others]] = found.point[: len(others)]
    point[len(fitted) :] = found.point[len(others) :]
    places = [fitted.index(name) for name in NAMES]
    grid = _grid(joint, point, places, settings.seed)
    return tuple(SearchedUnit(joint, one) for one in grid[: SCAN.starts])


def _grid(joint: JointObjective, point: Array, places: Sequence[int], seed: int) -> list[Array]:
    """Return points (d,) with other shafts than that of `point`, the best first."""
    m = joint.terms[0].objective.problem.actuator.mechanics
    described = lumped_parameters(joint.terms[0].objective.problem.actuator, NAMES)
    critical = 2 * math.sqrt(described["stiffness"] * m.inertia_motor * m.inertia_user / m.inertia)

    def at(factor: float, damping: float) -> Array:
        moved = point.copy()
        moved[places] = math.log(factor), math.log(damping / described["damping"])
        return joint.box.project(moved)

    coarse = [
        [at(factor, ratio * critical * factor**0.5) for ratio in SCAN.damping_ratios]
        for factor in SCAN.stiffness_factors
    ]
    tried = [one for row in coarse for one in _with_costs(joint, row, seed)]
    best = min(tried, key=lambda one: one[0])[1]
    for stiffer in SCAN.finer:
        near = []
        for damped in SCAN.finer:
            moved = best.copy()
            moved[places] += math.log(stiffer), 2 * math.log(damped)
            near.append(joint.box.project(moved))
        tried += _with_costs(joint, near, seed)
    return [one for _, one in sorted(tried, key=lambda one: one[0])]


def _with_costs(joint: JointObjective, points: Sequence[Array], seed: int) -> list[tuple[float, Array]]:
    """Return points (d,), each with the mean squared residual of the reference model's primary channel."""
    lengths = [term.objective.problem.duration_s for term in joint.terms]
    kept = sorted(range(len(lengths)), key=lambda r: lengths[r])[: SCAN.recordings]
    parts = [subset(joint, point, kept) for point in points]
    try:
        outcomes = compared(parts[0][0], np.array([one for _, one in parts]), seed, "shaft")
    except MethodError:  # a shaft so stiff or damped that the step is too long for it
        return [(math.inf, point) for point in points]
    return [(one.primary_variance, point) for one, point in zip(outcomes, points, strict=True)]
