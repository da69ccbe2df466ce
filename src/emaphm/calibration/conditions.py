"""Unknowns of a joint fit: the own unknowns of each recording, and the shared parameters of the unit."""

from collections.abc import Mapping, Sequence

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.actuator import described_parts
from emaphm.actuator.lumped_parameters import LUMPED_PARAMETERS, lumped_parameters
from emaphm.actuator.unit.baseline import SIGNED
from emaphm.arrays import Array
from emaphm.calibration.campaign import CampaignRow
from emaphm.errors import MethodError
from emaphm.estimation.compared_channels import has_signal
from emaphm.estimation.joint.objective import JointObjective, RecordingTerm
from emaphm.estimation.joint.search import DESCENT
from emaphm.estimation.objective import healthy_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.rows.means import over_swings
from emaphm.estimation.space.nuisances import MAGNETS, MAGNETS_DEVIATION, PRIORS_PER_UNIT, WIDEST, NuisanceSet
from emaphm.estimation.space.parameter_variation import ParameterVariation, sizes

SAME_PARAMETER = {"load": "offset", "hinge": "hinge", "inertia": "inertia", "supply": "supply"}
"""For each nuisance, the parameter from which one recording cannot separate it."""

OWN_DEVIATION = 0.2
"""Standard deviation of a recording's own value of a shared parameter from the shared value, relative: for
example a torque constant that varies with the temperature."""

TORQUES = (
    *("inertia", "viscous", "coulomb", "static", "offset", "hinge", "quadratic", "stiffness", "damping"),
    *("gravity", *(name for name in LUMPED_PARAMETERS if name.startswith(("ripple", "presliding")))),
)
"""Parameters of the torques that balance the motor's torque; without a recorded load, only their ratios to
the torque constant are known."""

FOLLOWING = ("static", "damping", "stiffness", "presliding_stiffness", "presliding_damping")
"""`TORQUES` that follow from another parameter, or do not act by themselves."""


def check_nuisances(nuisances: Sequence[str] | None, free: Sequence[str]) -> None:
    """Raise `MethodError` if a nuisance cannot be separated from a free parameter."""
    for name in nuisances or ():
        if SAME_PARAMETER.get(name) in free:
            raise MethodError(
                f"nuisance '{name}' cannot be separated from parameter '{SAME_PARAMETER[name]}'; leave "
                f"one out"
            )


def joint_objective(
    rows: Sequence[CampaignRow],
    actuator: Actuator,
    unit: ParameterVariation,
    nuisances: Sequence[str] | None,
    workers: int | None,
    *,
    every_row: bool = False,
) -> JointObjective:
    """Return the joint objective of all rows in the `unit`'s parameters and each recording's own unknowns.

    With a compliant shaft, rows are averaged over its oscillation (`emaphm.estimation.rows.means`), unless
    `every_row`. Raises the errors of `emaphm.calibration.calibrate`.
    """
    terms = tuple(_term(row, actuator, unit, nuisances, workers, every_row=every_row) for row in rows)
    return JointObjective(terms, unit, DESCENT.step, workers)


def _term(
    row: CampaignRow,
    actuator: Actuator,
    unit: ParameterVariation,
    nuisances: Sequence[str] | None,
    workers: int | None,
    *,
    every_row: bool,
) -> RecordingTerm:
    described = row.described(actuator, unit.parameters)
    problem = problem_of(row.completed(), described, workers=workers, channels=None)
    if not every_row:
        problem = over_swings(problem)
    # A known load or supply is no nuisance.
    settled = {*unit.parameters, *row.free, *row.known}
    possible = NuisanceSet.of(described, nuisances, tuple(problem.measured)).chosen
    chosen = tuple(
        name for name in possible if name not in settled and SAME_PARAMETER.get(name) not in settled
    )
    own = dict.fromkeys(row.free, OWN_DEVIATION)
    if "temperature" in chosen and "torque_constant" in unit.parameters:
        # The effect of heat on the magnets is uncertain, because it depends on their grade.
        magnets = MAGNETS_DEVIATION * abs(MAGNETS) * actuator.nuisances.temperature
        own["torque_constant"] = max(own.get("torque_constant", 0.0), magnets)
    objective = healthy_objective(problem, chosen, with_own(unit, described, own))
    return RecordingTerm.of(objective, unit.priors.size)


def with_own(unit: ParameterVariation, actuator: Actuator, own: Mapping[str, float]) -> ParameterVariation:
    """Return the parameter variation of a recording with `own` parameters; the shared axes are last.

    If an own parameter is also shared, it deviates from the shared value with the standard deviation in
    `own`; other own parameters have the wide prior of a free parameter.
    """
    names = tuple(own)
    alone = ParameterVariation.free(actuator, names)
    parameters = tuple(dict.fromkeys((*names, *unit.parameters)))
    # A deviation about a shared value is a nuisance, in the same coordinates.
    deviating = np.array([name in unit.parameters for name in names], bool)
    units = np.where(deviating, PRIORS_PER_UNIT * np.array(list(own.values())), 1.0)
    axes = np.zeros((len(parameters), len(names) + unit.priors.size))
    axes[: len(names), : len(names)] = alone.axes * units
    for name, row in zip(unit.parameters, unit.axes, strict=True):
        axes[parameters.index(name), len(names) :] = row
    return ParameterVariation(
        parameters,
        axes,
        np.concatenate([np.where(deviating, 1 / PRIORS_PER_UNIT, alone.priors), unit.priors]),
        np.concatenate([np.where(deviating, WIDEST / PRIORS_PER_UNIT, alone.widest), unit.widest]),
    )


def only_ratios(rows: Sequence[CampaignRow], actuator: Actuator, free: Sequence[str]) -> bool:
    """Return whether all recordings have information only on ratios of torques to the torque constant.

    A recorded or commanded voltage identifies the torque constant by the speed, a known load by the current
    that holds it.
    """
    if actuator.drive_kind == "voltage":
        return False
    present = (name for name in TORQUES if any(described_parts(actuator, name) or ()))
    acting = {name for name in present if name not in FOLLOWING}
    return (
        "torque_constant" in free
        and acting <= set(free)
        and not any(_has_torque_scale(r, actuator) for r in rows)
    )


def common_factor(actuator: Actuator, names: Sequence[str], deviations: Array) -> Array:
    """Return the derivative of the deviations (p,) by the logarithm of a common factor of all torques, (p,).

    `deviations` is the point at which the derivative is evaluated.
    """
    effects = np.array([float(name in (*TORQUES, "torque_constant")) for name in names])
    for i, (name, size) in enumerate(zip(names, sizes(actuator, tuple(names)), strict=True)):
        if name in SIGNED and effects[i]:
            effects[i] = lumped_parameters(actuator, (name,))[name] / size + deviations[i]
    return effects


def _has_torque_scale(row: CampaignRow, actuator: Actuator) -> bool:
    """Return whether a recording identifies the torque constant itself."""
    by_voltage = actuator.electrical is not None and has_signal(row.recording, "voltage_V")
    by_torque = any(row.known.get(name) for name in (*TORQUES, "load", "torque_constant"))
    by_load = "load_Nm" in row.recording and np.any(row.recording["load_Nm"])
    return bool(by_voltage or by_torque or by_load)
