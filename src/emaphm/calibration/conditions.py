"""What a recording of a campaign is fitted with: its own unknowns, and those that all recordings share."""

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
"""The parameter that a nuisance cannot be separated from in one recording."""

OWN_DEVIATION = 0.2
"""Standard deviation of a recording's own value of a shared parameter about the shared one, relative: as of a
motor's strength that varies with its temperature."""

TORQUES = (
    *("inertia", "viscous", "coulomb", "static", "offset", "hinge", "quadratic", "stiffness", "damping"),
    *("gravity", *(name for name in LUMPED_PARAMETERS if name.startswith(("ripple", "presliding")))),
)
"""What the motor's torque has to overcome where no load is recorded: known in proportion to it only."""

FOLLOWING = ("static", "damping", "stiffness", "presliding_stiffness", "presliding_damping")
"""Those of them that another one makes known, or that do not act by themselves."""


def check_nuisances(nuisances: Sequence[str] | None, free: Sequence[str]) -> None:
    """Refuse a nuisance that cannot be separated from a free parameter."""
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
    """Return the objective of the `unit`'s parameters and of each recording's own, by every channel.

    Where the shaft gives, rows are averaged over its swings (`emaphm.estimation.rows.means`), unless
    `every_row` is to be compared. Errors as in `emaphm.calibration.calibrate`.
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
    # Of a known load or supply nothing is unknown.
    settled = {*unit.parameters, *row.free, *row.known}
    possible = NuisanceSet.of(described, nuisances, tuple(problem.measured)).chosen
    kept = tuple(name for name in possible if name not in settled and SAME_PARAMETER.get(name) not in settled)
    own = dict.fromkeys(row.free, OWN_DEVIATION)
    if "temperature" in kept and "torque_constant" in unit.parameters:
        # What heat makes of the magnets is known no better than their grade.
        magnets = MAGNETS_DEVIATION * abs(MAGNETS) * actuator.nuisances.temperature
        own["torque_constant"] = max(own.get("torque_constant", 0.0), magnets)
    objective = healthy_objective(problem, kept, with_own(unit, described, own))
    return RecordingTerm.of(objective, unit.priors.size)


def with_own(unit: ParameterVariation, actuator: Actuator, own: Mapping[str, float]) -> ParameterVariation:
    """Return the variation of a recording whose parameters `own` are its own; the shared axes last.

    A shared parameter among them deviates from the shared value with the standard deviation given in `own`;
    of any other, next to nothing is known.
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

    A voltage, also as command, shows the constant by the speed, a known load by the current that holds it.
    """
    if actuator.drive_kind == "voltage":
        return False
    present = (name for name in TORQUES if any(described_parts(actuator, name) or ()))
    acting = {name for name in present if name not in FOLLOWING}
    return "torque_constant" in free and acting <= set(free) and not any(_scaled(r, actuator) for r in rows)


def common_factor(actuator: Actuator, names: Sequence[str], deviations: Array) -> Array:
    """Return the effect on `deviations` (p,) of a common factor of all torques, by its logarithm, (p,)."""
    effects = np.array([float(name in (*TORQUES, "torque_constant")) for name in names])
    for i, (name, size) in enumerate(zip(names, sizes(actuator, tuple(names)), strict=True)):
        if name in SIGNED and effects[i]:
            effects[i] = lumped_parameters(actuator, (name,))[name] / size + deviations[i]
    return effects


def _scaled(row: CampaignRow, actuator: Actuator) -> bool:
    by_voltage = actuator.electrical is not None and has_signal(row.recording, "voltage_V")
    by_torque = any(row.known.get(name) for name in (*TORQUES, "load", "torque_constant"))
    by_load = "load_Nm" in row.recording and np.any(row.recording["load_Nm"])
    return bool(by_voltage or by_torque or by_load)
