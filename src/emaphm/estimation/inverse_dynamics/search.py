"""Variable projection: linear least squares within a search over the nonlinear parameters."""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.estimation.inverse_dynamics.problem import InverseProblem
from emaphm.estimation.inverse_dynamics.torque_balance import LOADS, measured_torque
from emaphm.estimation.space.parameter_variation import SPEEDS

LINEAR = ("inertia", "viscous", "quadratic", "coulomb", "static", "offset", "hinge", "gravity")
"""Parameters that the torque balance is linear in, in addition to the torque ripple's."""

NOT_NEGATIVE = ("inertia", "viscous", "quadratic", "coulomb", "gravity")
"""Linear parameters that have one sign."""

LEAST_PEAK = 1e-6
"""Lower limit of the excess of static over Coulomb friction, relative to the rms torque: at 0, the derivative
by a Stribeck speed vanishes."""

SPEED_STARTS = (0.01, 0.05, 0.25)
"""Starts of the search for each of `SPEEDS`, relative to the rms speed."""

ANGLE_STARTS = (-2.1, 0.0, 2.1)
"""Starts of the search for the angle of a weight, a third of a turn apart [rad]."""

LOAD_START = 0.1
"""Start of the search for load-dependent friction that is not described [-]."""

POSITIVE = (*SPEEDS, "torque_constant", "resistance")
"""Parameters whose logarithm is searched."""

LEAST_LOAD = 1e-6
"""Lower limit of load-dependent friction [-]: at 0, an absolute value has no derivative."""

MOST_LOAD = {"friction": 0.45, "motor": 0.45, "external": 10.0}
"""Upper limit of load-dependent friction, by the torque that it depends on [-]: at a loss of 1 of the motor's
torque, nothing would move, and two such losses add up."""

WIDEST = 100.0
"""Largest factor between a torque constant or resistance and its description."""

STILL_SHARE = 0.1
"""Least Stribeck or transition speed, relative to the speed below which the shaft counts as standing."""

SEARCH_STEP = 1e-3
"""Step of the outer search's differences, relative."""

SEARCHES = 2
"""Number of outer searches, from the starts with the least projected residual."""

SEARCH_TOLERANCE = 1e-4
"""Relative change of the objective or the parameters at which an outer search ends."""

MOST_STEPS = 30
"""Largest number of steps of an outer search; the final search over all parameters continues from there."""

LARGEST_ASYMMETRY = 0.95
"""Largest asymmetry: at 1, one direction would have no friction."""

AT_BOUND = 1e-3
"""Distance to a bound, relative to the width of the search, up to which a parameter is at the bound."""

LEAST_COLUMN = 1e-12
"""Lower limit of a column's norm for the scaling of a linear parameter, relative to the largest norm."""


@dataclass(frozen=True, eq=False)
class Minimum:
    """The optimal `point` (p,), the prediction's `jacobian` (rows, p), and the parameters `at_bound`."""

    point: Array
    jacobian: Array
    at_bound: tuple[str, ...]


def minimised(problem: InverseProblem, start: Array | None = None) -> Minimum:
    """Return the optimum of `problem`, from the description or from the `start` (p,) of an earlier search."""
    from scipy.optimize import least_squares

    linear = np.array([_is_linear(name) for name, _ in problem.keys])
    lower, upper = _bounds(problem)
    if start is None:
        screened = sorted(
            (with_linear_solved(problem, candidate, linear, lower, upper) for candidate in _starts(problem)),
            key=lambda point: float(np.sum(problem.residual(point) ** 2)),
        )
        projected = [
            _projected_search(problem, candidate, linear, lower, upper) for candidate in screened[:SEARCHES]
        ]
        best = min(projected, key=lambda point: float(np.sum(problem.residual(point) ** 2)))
    else:
        best = with_linear_solved(problem, start, linear, lower, upper)

    def residual_jacobian(point: Array) -> Array:
        return -problem.jacobian(point)

    if not linear.all():
        best = least_squares(
            problem.residual,
            best,
            jac=residual_jacobian,
            bounds=(lower, upper),
            x_scale="jac",
        ).x
        # That search stays inside its bounds by about 1e-22; this step moves such values onto the bound.
        best = with_linear_solved(problem, best, linear, lower, upper)
    width = upper - lower
    distance = np.minimum(best - lower, upper - best)
    near = np.where(np.isfinite(width), distance < AT_BOUND * width, distance <= 0)
    return Minimum(
        best,
        problem.jacobian(best),
        tuple(label for label, at in zip(problem.labels, near, strict=True) if at),
    )


def _is_linear(name: str) -> bool:
    """Return whether the torque balance is linear in the parameter."""
    return name in LINEAR or name.startswith("ripple")


def _projected_search(
    problem: InverseProblem, start: Array, linear: NDArray[np.bool_], lower: Array, upper: Array
) -> Array:
    """Return the optimum (p,) of a search from `start` over the parameters that are not `linear` (p,)."""
    from scipy.optimize import least_squares

    if linear.all():
        return with_linear_solved(problem, start, linear, lower, upper)
    logarithmic = np.array([name in POSITIVE for name, _ in problem.keys])[~linear]

    def point_of(searched: Array) -> Array:
        point = start.copy()
        point[~linear] = np.where(logarithmic, np.exp(searched), searched)
        return with_linear_solved(problem, point, linear, lower, upper)

    def searched_of(values: Array) -> Array:
        nonlinear = values[~linear]
        return np.where(logarithmic, np.log(np.where(logarithmic, nonlinear, 1.0)), nonlinear)

    def residual_of(searched: Array) -> Array:
        return problem.residual(point_of(searched))

    optimum = least_squares(
        residual_of,
        searched_of(start),
        bounds=(searched_of(lower), searched_of(upper)),
        diff_step=np.full(int(np.sum(~linear)), SEARCH_STEP),
        max_nfev=MOST_STEPS,
        ftol=SEARCH_TOLERANCE,
        xtol=SEARCH_TOLERANCE,
    )
    return np.clip(point_of(optimum.x), lower, upper)


def with_linear_solved(
    problem: InverseProblem, point: Array, linear: NDArray[np.bool_], lower: Array, upper: Array
) -> Array:
    """Return `point` (p,) with its `linear` parameters replaced by their bounded least-squares solution."""
    from scipy.optimize import lsq_linear

    if not linear.any():
        return point
    columns = problem.jacobian(point, linear)
    norms = np.linalg.norm(columns, axis=0)
    # A parameter whose column is nearly 0, such as static friction at a tiny Stribeck speed, is unidentified.
    size = np.maximum(norms, max(LEAST_COLUMN * norms.max(), np.finfo(float).tiny))
    target = problem.residual(point) + columns @ point[linear]
    solution = lsq_linear(columns / size, target, (lower[linear] * size, upper[linear] * size), method="bvls")
    solved = point.copy()
    # The rounding error of the scaling may move a value on a bound beyond it.
    solved[linear] = np.clip(solution.x / size, lower[linear], upper[linear])
    return solved


def _starts(problem: InverseProblem) -> list[Array]:
    """Return the starts of the search: several values of free speeds and angles, or else the description."""
    start = problem.start
    names = [name for name, _ in problem.keys]
    for k, name in enumerate(names):
        if name in LOADS and start[k] == 0:
            start[k] = LOAD_START
    speed = np.sqrt(np.mean([np.mean(motion.speed**2) for motion in problem.motions]))
    options = {
        k: tuple(share * speed for share in SPEED_STARTS) if name in SPEEDS else ANGLE_STARTS
        for k, name in enumerate(names)
        if name in (*SPEEDS, "gravity_angle")
    }
    starts = []
    for values in itertools.product(*options.values()):
        candidate = start.copy()
        candidate[list(options)] = values
        starts.append(candidate)
    return starts


def _bounds(problem: InverseProblem) -> tuple[Array, Array]:
    """Return the lower and upper bounds (p,) of the search; infinite for unbounded parameters."""
    slowest = STILL_SHARE * min(motion.still_speed for motion in problem.motions)
    fastest = max(float(np.max(np.abs(motion.speed))) for motion in problem.motions)
    measured = [measured_torque(motion, problem.described) for motion in problem.motions]
    torque = np.sqrt(np.mean([np.mean(of_motion**2) for of_motion in measured]))
    described = problem.start
    lower, upper = np.full(described.size, -np.inf), np.full(described.size, np.inf)
    for k, (name, _) in enumerate(problem.keys):
        if name in SPEEDS:
            lower[k], upper[k] = slowest, fastest
        elif name in LOADS:
            lower[k], upper[k] = LEAST_LOAD, MOST_LOAD[name.rpartition("_")[2]]
        elif name in NOT_NEGATIVE:
            lower[k] = 0.0
        elif name == "static":
            lower[k] = LEAST_PEAK * torque
        elif name.endswith("_asymmetry"):
            lower[k], upper[k] = -LARGEST_ASYMMETRY, LARGEST_ASYMMETRY
        elif name in POSITIVE:
            lower[k], upper[k] = described[k] / WIDEST, described[k] * WIDEST
    return lower, upper
