"""Inverse dynamics identification: parameters from measured motion, by variable projection.

The torque balance is linear in most parameters. For given values of the nonlinear parameters, the linear
ones follow from linear least squares; the search over the nonlinear parameters minimises the projected
residual (Golub and Pereyra 1973). A final Gauss-Newton search over all parameters ends at the optimum.
"""

from collections.abc import Mapping, Sequence

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
from emaphm.estimation.inverse_dynamics.search import Minimum, minimised
from emaphm.estimation.inverse_dynamics.torque_balance import NAMES, Values, measured_torque
from emaphm.estimation.uncertainty.collinearity import CollinearSet, collinear_coordinates, listed
from emaphm.estimation.uncertainty.covariance import sandwich_covariance
from emaphm.estimation.uncertainty.long_run_variance import long_run_covariance
from emaphm.estimation.uncertainty.repeated_errors import ScoreSeries, repeated_errors
from emaphm.recording import Recording

SINGULAR = 1e-6
"""Singular value of the scaled Jacobian, relative to the largest, below which parameters are collinear."""

SHARED = 0.1
"""Least component of a parameter in a direction without effect for it to be named as a part of it."""


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
) -> InverseDynamicsResult:
    """Return the parameters `free` that explain the torque of the measured motion; no controller is needed.

    The position, and its differences as speed and acceleration, are inserted into the torque balance
    (`emaphm.estimation.inverse_dynamics.torque_balance`). The result is compared with the recorded current,
    or with the voltage if the current was not recorded. Both sides pass the same low-pass.

    Rows at standstill are left out (`RowThinning`): friction then balances any torque up to static friction,
    so the torque contains no information on Coulomb friction, and the balanced torque would cause errors of
    the other parameters. Rows of a fast reversal are used.

    Parameters
    ----------
    recordings
        Recordings of one fit, each weighted by its own residual.
    actuator
        Parameters that are not free keep its values; static friction keeps its ratio to Coulomb friction.
    free
        Names from `emaphm.estimation.inverse_dynamics.torque_balance.NAMES`, whether their law is described
        or not, and of the harmonics of the described torque ripple.
    known
        For each recording, values that replace those of the actuator or a common estimate.
    per_recording
        Free parameters with a value of their own in each recording; the torque constant in each recording
        except the first, which keeps the actuator's value.
    channel
        Channel that the motion is compared with: "current_A", "voltage_V" or "duty"; by default the first of
        these that was recorded.
    position_hz, regression_hz
        Cutoff frequencies of the low-passes; by default chosen from each recording.

    Returns
    -------
    Estimates with standard errors from the sandwich covariance, which allows correlated residuals. The
    standard errors do not include the effect of the position's low-pass, about 0.2 %.

    Notes
    -----
    Least squares without instrumental variables [2]: with the cutoff from the position's noise, the bias is
    0.3 % at a noise of 1e-4 of the motion's amplitude, and 1 % at 1e-3
    (``tests/estimation/test_inverse_dynamics.py``). A second pass with simulated motion, which needs the
    controller, would therefore not improve the estimates.

    Raises
    ------
    MethodError
        No parameter is free, a free parameter is unknown, or no recording identifies it (alone or with the
        others).
    RecordingError
        A recording has no position, no channel that shows the torque, or no motion.

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
    known_values = [dict(values) for values in known] if known is not None else [{} for _ in given]
    described = described_values(actuator)
    _check(given, names, known_values, per_recording, described)
    motions = [
        Motion.of(recording, actuator, position_hz=position_hz, regression_hz=regression_hz, channel=channel)
        for recording in given
    ]
    orders = tuple(
        harmonic.order * (actuator.mechanics.screw_ratio if harmonic.of == "screw" else 1.0)
        for harmonic in actuator.ripple
    )
    problem = InverseProblem.of(motions, described, names, known_values, tuple(per_recording), orders)
    minimum = minimised(problem)
    problem = problem.reweighted(minimum.point)
    minimum = minimised(problem, minimum.point)
    _check_identifiable(problem, minimum.jacobian)
    residual = problem.residual(minimum.point)
    # Scale each parameter by its effect on the prediction, so that the matrix to invert is well conditioned.
    size = np.linalg.norm(minimum.jacobian, axis=0)
    scaled = (minimum.jacobian / size).T[np.newaxis]
    repeated_scores, correlation = _repeated_scores(problem, scaled[0] * residual)
    no_prior = np.full(minimum.point.size, np.inf)
    covariance = sandwich_covariance(scaled, residual, no_prior, error_scores=repeated_scores).covariance
    covariance = problem.parameter_covariance(covariance / np.outer(size, size))
    return _result(problem, minimum, covariance, residual, correlation, actuator)


def _repeated_scores(problem: InverseProblem, scores: Array) -> tuple[Array, float | None]:
    """Return the additional covariance (p, p) of the summed `scores` (p, rows) due to repeated motions.

    The second value is the correlation of the residuals of recordings of one motion. The results are 0 and
    None if the correlation is not significant.
    """
    ends = np.cumsum([target.size for target in problem.targets])
    series = []
    for motion, thinning, its_scores in zip(
        problem.motions, problem.thinnings, np.split(scores, ends[:-1], axis=1), strict=True
    ):
        at_all_rows = np.zeros((len(scores), motion.angle.size))
        at_all_rows[:, thinning.kept] = its_scores
        series.append(ScoreSeries(at_all_rows, motion.angle, motion.interval))
    shared = np.flatnonzero([recording is None for _, recording in problem.keys])
    repeated = repeated_errors(series, shared, max(thinning.step for thinning in problem.thinnings))
    if repeated.correlation is None:
        return np.zeros_like(repeated.covariance), None
    return repeated.covariance - long_run_covariance(scores), repeated.correlation


def described_values(actuator: Actuator) -> dict[str, float]:
    """Return the actuator's described values of the parameters of inverse dynamics."""
    values = {}
    for name in (*NAMES, *(name for name in LUMPED_PARAMETERS if name.startswith("ripple"))):
        parts = described_parts(actuator, name)
        if parts is not None:
            values[name] = float(sum(parts))
    return values


def _check(
    recordings: Sequence[Recording],
    names: tuple[str, ...],
    known: Sequence[Values],
    per_recording: Sequence[str],
    described: Values,
) -> None:
    """Raise MethodError for impossible arguments of `inverse_dynamics`."""
    if not recordings:
        raise MethodError("no recording for inverse dynamics; give one or several")
    if not names:
        raise MethodError(f"no parameter is free; name some of {', '.join(NAMES)}")
    if len(known) != len(recordings):
        raise MethodError(
            f"known values of {len(known)} recordings for {len(recordings)}; give one set for each"
        )
    possible = tuple(dict.fromkeys((*NAMES, *described)))
    for name in (*names, *per_recording, *(name for values in known for name in values)):
        if name not in possible:
            raise MethodError(f"inverse dynamics does not know '{name}'{nearest(name, possible)}")
    for name in per_recording:
        if name not in names:
            raise MethodError(f"'{name}' has a value for each recording but is not free; free it too")


def _check_identifiable(problem: InverseProblem, jacobian: Array) -> None:
    """Raise MethodError if the recordings do not identify a parameter, alone or with the others."""
    size = np.sqrt(np.mean(jacobian**2, axis=0))
    labels = problem.labels
    without_effect = [label for label, effect in zip(labels, size, strict=True) if not 0 < effect < np.inf]
    if without_effect:
        raise MethodError(
            f"no recording shows {listed(without_effect, 'or')} in its motion; record one that moves there, "
            "or do not free it"
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
    minimum: Minimum,
    covariance: Array,
    residual: Array,
    error_correlation: float | None,
    actuator: Actuator,
) -> InverseDynamicsResult:
    """Return the result at the minimum, with the parameters' `covariance` (p, p)."""
    point = minimum.point
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
        at_bound=minimum.at_bound,
        actuator=actuator,
        error_correlation=error_correlation,
    )


def _replay(problem: InverseProblem, i: int, point: Array) -> ForceReplay:
    """Return the replay of recording `i` at `point` (p,)."""
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
