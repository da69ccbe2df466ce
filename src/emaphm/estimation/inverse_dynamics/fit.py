"""Inverse dynamics identification: parameters from measured motion, by variable projection.

Given the few parameters that the torque balance is not linear in, the others follow from linear least
squares; a search over the few has the projected residual as its objective (Golub and Pereyra 1973). A last
Gauss-Newton search over all of them ends at the optimum.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.actuator import described_parts
from emaphm.actuator.quantity import unit_for
from emaphm.actuator.unit.baseline import LUMPED_PARAMETERS
from emaphm.arrays import Array
from emaphm.errors import MethodError, nearest
from emaphm.estimation.inverse_dynamics.motion import Motion
from emaphm.estimation.inverse_dynamics.problem import InverseProblem
from emaphm.estimation.inverse_dynamics.result import ForceReplay, InverseDynamicsResult, ParameterEstimate
from emaphm.estimation.inverse_dynamics.search import minimised
from emaphm.estimation.inverse_dynamics.torque_balance import NAMES, Values, measured_torque
from emaphm.estimation.uncertainty.collinearity import CollinearSet, collinear_coordinates, listed
from emaphm.estimation.uncertainty.covariance import sandwich_covariance
from emaphm.estimation.uncertainty.long_run_variance import long_run_covariance
from emaphm.estimation.uncertainty.repeated_errors import ScoreSeries, repeated_errors
from emaphm.recording import Recording

SINGULAR = 1e-6
"""Smallest singular value of the scaled Jacobian, relative to the largest, of parameters that differ."""

SHARED = 0.1
"""Least component of a direction without effect, for a parameter to be named as part of it."""


def inverse_dynamics(
    recordings: Recording | Sequence[Recording],
    actuator: Actuator,
    free: Sequence[str],
    *,
    known: Sequence[Mapping[str, float]] | None = None,
    per_recording: Sequence[str] = (),
    channel: str | None = None,
    position_hz: float | None = None,
    regression_hz: float | None = None,
    still_speed: float | None = None,
) -> InverseDynamicsResult:
    """Return the parameters `free` that explain the torque of the measured motion; no controller is needed.

    Position, and speed and acceleration by differences of it, go into the torque balance
    (`emaphm.estimation.inverse_dynamics.torque_balance`); the recorded current is compared, or the voltage
    where there is no current. Both sides pass the same low-pass.

    Rows at standstill are left out (`RowThinning`): friction then balances any torque up to the static
    one, so that the torque says nothing of Coulomb friction, and whatever it balances would go into the
    other parameters. A reversal that passes quickly stays in.

    Parameters
    ----------
    recordings
        All go into one fit, each weighted by its own residual.
    actuator
        Parameters that are not free keep its values; static friction keeps its ratio to Coulomb friction.
    free
        Names from `emaphm.estimation.inverse_dynamics.torque_balance.NAMES`, of laws that the description has
        or lacks, and of the harmonics of its torque ripple.
    known
        For each recording, values that hold in it instead of the actuator's or of a common estimate.
    per_recording
        Free parameters that have a value of their own in each recording; of the torque constant, in each
        but the first, which keeps the actuator's.
    channel
        "current_A", "voltage_V" or "duty", what the motion is compared with; the first one that was recorded
        where left out.
    position_hz, regression_hz
        Cutoff frequencies of the low-passes; chosen from each recording where left out.
    still_speed
        Motor speed below which the shaft counts as still [rad/s]; from the recording where left out.

    Returns
    -------
    Estimates with standard errors by the sandwich covariance, which admits correlated residuals. They do not
    cover what the low-pass of the position changes, some 0.2 %.

    Notes
    -----
    Least squares without instrumental variables [2]: the cutoff that follows the position's noise leaves a
    bias of 0.3 % at a noise of 1e-4 of the motion's amplitude, and of 1 % at 1e-3
    (``tests/estimation/test_inverse_dynamics.py``), so that a second pass with simulated motion, which needs
    the controller, has nothing to gain.

    Raises
    ------
    MethodError
        No parameter, or an unknown one, is free; or no recording shows one, alone or with the others.
    RecordingError
        A recording has no position, or nothing that shows the torque, or never moves.

    References
    ----------
    [1] M. Gautier: dynamic identification of robots with power model, IEEE ICRA 1997: parallel filtering.
    [2] A. Janot, P.-O. Vandanjon, M. Gautier: a generic instrumental variable approach for industrial robot
        identification, IEEE Trans. Control Systems Technology 22(1), 2014.
    [3] G. Golub, V. Pereyra: the differentiation of pseudo-inverses and nonlinear least squares problems
        whose variables separate, SIAM J. Numerical Analysis 10(2), 1973.
    """
    given = (recordings,) if isinstance(recordings, Recording) else tuple(recordings)
    names = tuple(dict.fromkeys(free))
    own = [dict(one) for one in known] if known is not None else [{} for _ in given]
    described = described_values(actuator)
    _check(given, names, own, per_recording, described)
    motions = [
        Motion.of(
            one,
            actuator,
            position_hz=position_hz,
            regression_hz=regression_hz,
            still_speed=still_speed,
            channel=channel,
        )
        for one in given
    ]
    orders = tuple(
        one.order * (actuator.mechanics.screw_ratio if one.of == "screw" else 1.0) for one in actuator.ripple
    )
    problem = InverseProblem.of(motions, described, names, own, tuple(per_recording), orders)
    found = minimised(problem)
    problem = problem.reweighted(found.point)
    found = minimised(problem, found.point)
    _refuse_singular(problem, found.jacobian)
    residual = problem.residual(found.point)
    # In units of what each parameter moves, so that the inverse is not spoilt by theirs.
    size = np.linalg.norm(found.jacobian, axis=0)
    scaled = (found.jacobian / size).T[np.newaxis]
    alike, correlation = _repeated_scores(problem, scaled[0] * residual)
    unknown = np.full(found.point.size, np.inf)
    covariance = sandwich_covariance(scaled, residual, unknown, error_scores=alike).covariance
    covariance = problem.parameter_covariance(covariance / np.outer(size, size))
    result = _result(problem, found.point, covariance, residual, found.at_bound, actuator)
    return replace(result, error_correlation=correlation)


def _repeated_scores(problem: InverseProblem, scores: Array) -> tuple[Array, float | None]:
    """Return what recordings of one motion add to the covariance (p, p) of the sum of `scores` (p, rows).

    And how alike the residuals are in them; 0 and None where no more than by chance.
    """
    ends = np.cumsum([target.size for target in problem.targets])
    series = []
    for motion, thinned, own in zip(
        problem.motions, problem.thinnings, np.split(scores, ends[:-1], axis=1), strict=True
    ):
        every_row = np.zeros((len(scores), motion.angle.size))
        every_row[:, thinned.kept] = own
        series.append(ScoreSeries(every_row, motion.angle, motion.interval))
    shared = np.flatnonzero([recording is None for _, recording in problem.keys])
    repeated = repeated_errors(series, shared, max(one.step for one in problem.thinnings))
    if repeated.correlation is None:
        return np.zeros_like(repeated.covariance), None
    return repeated.covariance - long_run_covariance(scores), repeated.correlation


def described_values(actuator: Actuator) -> dict[str, float]:
    """Return the actuator's values of the parameters that inverse dynamics knows, and that it has."""
    found = {}
    for name in (*NAMES, *(name for name in LUMPED_PARAMETERS if name.startswith("ripple"))):
        parts = described_parts(actuator, name)
        if parts is not None:
            found[name] = float(sum(parts))
    return found


def _check(
    recordings: Sequence[Recording],
    names: tuple[str, ...],
    known: Sequence[Values],
    per_recording: Sequence[str],
    described: Values,
) -> None:
    if not recordings:
        raise MethodError("no recording for inverse dynamics; give one or several")
    if not names:
        raise MethodError(f"no parameter is free; name some of {', '.join(NAMES)}")
    if len(known) != len(recordings):
        raise MethodError(
            f"known values of {len(known)} recordings for {len(recordings)}; give one set for each"
        )
    possible = tuple(dict.fromkeys((*NAMES, *described)))
    for name in (*names, *per_recording, *(name for one in known for name in one)):
        if name not in possible:
            raise MethodError(f"inverse dynamics does not know '{name}'{nearest(name, possible)}")
    for name in per_recording:
        if name not in names:
            raise MethodError(f"'{name}' has a value for each recording but is not free; free it too")


def _refuse_singular(problem: InverseProblem, jacobian: Array) -> None:
    """Refuse parameters that no recording shows, alone or with the others."""
    size = np.sqrt(np.mean(jacobian**2, axis=0))
    labels = problem.labels
    silent = [label for label, one in zip(labels, size, strict=True) if not 0 < one < np.inf]
    if silent:
        raise MethodError(
            f"no recording shows {listed(silent, 'or')} in its motion; record one that moves there, or do "
            "not free it"
        )
    _, values, directions = np.linalg.svd(jacobian / size, full_matrices=False)
    if values[-1] < SINGULAR * values[0]:
        members = [label for label, share in zip(labels, directions[-1], strict=True) if abs(share) > SHARED]
        raise MethodError(
            f"{listed(members, 'and')} act alike in these recordings, so that only a combination of them "
            "is known; free all but one, or give the value of one"
        )


def _result(
    problem: InverseProblem,
    point: Array,
    covariance: Array,
    residual: Array,
    at_bound: tuple[str, ...],
    actuator: Actuator,
) -> InverseDynamicsResult:
    shared = [k for k, (_, recording) in enumerate(problem.keys) if recording is None]
    values, errors = problem.parameters(point), np.sqrt(np.diag(covariance))
    parameters = {}
    for k in shared:
        name = problem.keys[k][0]
        unit = unit_for(LUMPED_PARAMETERS[name], actuator.coordinates)
        parameters[name] = ParameterEstimate(float(values[k]), float(errors[k]), unit)
    channels = tuple(dict.fromkeys(motion.channel for motion in problem.motions))
    collinear = tuple(
        CollinearSet(tuple(problem.labels[k] for k in members), channels)
        for members in (collinear_coordinates(covariance) if point.size > 1 else [])
    )
    replays = tuple(_replay(problem, i, point) for i in range(len(problem.motions)))
    squares = sum(float(np.sum((problem.targets[i] * problem.weights[i]) ** 2)) for i in range(len(replays)))
    return InverseDynamicsResult(
        parameters=parameters,
        covariance=covariance[np.ix_(shared, shared)],
        residual=residual,
        relative_error=float(np.sqrt(np.sum(residual**2) / squares)),
        replays=replays,
        collinear=collinear,
        at_bound=at_bound,
        actuator=actuator,
    )


def _replay(problem: InverseProblem, i: int, point: Array) -> ForceReplay:
    motion, thinned, values = problem.motions[i], problem.thinnings[i], problem.values(point, i)
    predicted = problem.predicted(point, i)
    error = np.linalg.norm(problem.targets[i] - predicted) / np.linalg.norm(problem.targets[i])
    return ForceReplay(
        source=motion.source,
        channel=motion.channel,
        frequencies=motion.frequencies,
        still_speed=motion.still_speed,
        still_rows=int(np.sum(~motion.moving)),
        time=motion.time[thinned.kept],
        measured=thinned(measured_torque(motion, values)),
        predicted=thinned(problem.torque(point, i)),
        relative_error=float(error),
        values={
            **problem.known[i],
            **{
                name: float(value)
                for (name, recording), value in zip(problem.keys, problem.parameters(point), strict=True)
                if recording == i
            },
        },
    )
