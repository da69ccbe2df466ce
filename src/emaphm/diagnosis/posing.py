"""The objective that a diagnosis minimises on one recording."""

from collections.abc import Sequence

from emaphm.actuator import Actuator
from emaphm.errors import MethodError, nearest
from emaphm.estimation.compared_channels import TORQUE_CURRENTS
from emaphm.estimation.methods import Method
from emaphm.estimation.objective import MapObjective, faults_objective, faults_only_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.problem import Problem
from emaphm.estimation.rows.after_jumps import rows_after_jumps
from emaphm.estimation.rows.means import masks_of_means, over_swings
from emaphm.recording import Recording
from emaphm.recording.schema import SCHEMA
from emaphm.recording.sensor_checks import CheckedRecording
from emaphm.simulation import Model


def without_spoilt_rows(objective: MapObjective, checked: CheckedRecording) -> MapObjective:
    """Return the objective of a checked recording without the rows that the checks found unusable."""
    return objective.ignoring(masks_of_means(checked.unusable, objective.problem))


def objective_for(
    recording: Recording,
    actuator: Actuator,
    method: Method,
    model: Model,
    nuisances: Sequence[str] | None,
    workers: int | None,
    *,
    below_healthy: bool = True,
) -> MapObjective:
    """Return the objective that `method` minimises on a recording.

    With least squares, this is the residual of all channels, with faults and nuisances as parameters. Rows
    right after a jump of the command are omitted where they depend on the exact instant of the jump. Without
    `below_healthy`, the friction has a lower bound at its healthy value. Without least squares, this is the
    residual of the current, with only the faults as parameters, in [0, 1].

    Raises
    ------
    MethodError
        A nuisance is unknown, or needs an electrical description that the actuator lacks; or the method
        estimates no nuisances.
    """
    problem = problem_of(recording, actuator, model, workers, None if method.least_squares else ())
    _check_current(problem, recording)
    if method.least_squares:
        problem = over_swings(problem)
        objective = faults_objective(problem, nuisances, below_healthy=below_healthy)
        return objective.ignoring(rows_after_jumps(problem))
    if nuisances:
        raise MethodError(
            f"method '{method.name}' estimates faults alone; leave out nuisance '{nuisances[0]}', or use "
            f"'{method.name}+lsq'"
        )
    return faults_only_objective(problem)


def _check_current(problem: Problem, recording: Recording) -> None:
    """Refuse a recording without a current: no other channel identifies faults of windings and magnets."""
    if problem.primary in TORQUE_CURRENTS:
        return
    others = [name for name in recording if name not in SCHEMA]
    hint = nearest("current_A", others, "columns not used") if others else ""
    raise MethodError(
        f"{recording.source}: a diagnosis of all faults needs a current, and there is only "
        f"{', '.join(problem.channels)}{hint}; record current_A, or the three phases with angle_rad, or "
        "name it under [channels] in the actuator's TOML (replay and calibrate do without)"
    )
