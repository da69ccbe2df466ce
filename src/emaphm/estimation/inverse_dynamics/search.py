"""Variable projection: linear least squares inside, a search over the other parameters outside."""

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
"""Least excess of static over Coulomb friction, relative to the rms torque: at 0, a Stribeck speed has no
derivative."""

SPEED_STARTS = (0.01, 0.05, 0.25)
"""Where the search for each of `SPEEDS` starts, relative to the rms speed."""

ANGLE_STARTS = (-2.1, 0.0, 2.1)
"""Where the search for the angle of a weight starts, a third of a turn apart [rad]."""

LOAD_START = 0.1
"""Load-dependent friction that a search begins at, where the description has none [-]."""

POSITIVE = (*SPEEDS, "torque_constant", "resistance")
"""Parameters that are searched in their logarithm."""

LEAST_LOAD = 1e-6
"""Least load-dependent friction of a search [-]: at 0, an absolute value has no derivative."""

MOST_LOAD = {"friction": 0.45, "motor": 0.45, "external": 10.0}
"""Largest, by what it follows [-]: if 1 of the motor's torque were lost, nothing would move; two add up."""

WIDEST = 100.0
"""Factor by which a torque constant or resistance may differ from its description."""

STILL_SHARE = 0.1
"""Slowest Stribeck or transition speed, relative to the speed that counts as still."""

SEARCH_STEP = 1e-3
"""Step of the outer search's differences, relative."""

SEARCHES = 2
"""Outer searches, from the starts with the least projected residual."""

SEARCH_TOLERANCE = 1e-4
"""Relative change of the objective or the parameters at which an outer search ends."""

MOST_STEPS = 30
"""Steps of an outer search; the last search over all parameters goes on from there."""

LARGEST_ASYMMETRY = 0.95
"""Beyond, one direction would have no friction."""

AT_BOUND = 1e-3
"""Distance to a bound, relative to the width of the search, that counts as lying on it."""

LEAST_COLUMN = 1e-12
"""Least size of a column, relative to the largest, that a linear parameter is scaled by."""


@dataclass(frozen=True, eq=False)
class Minimum:
    """The optimal `point` (p,), the derivatives of the prediction there (rows, p), and who is at a bound."""

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
            (with_linear_solved(problem, one, linear, lower, upper) for one in _starts(problem)),
            key=lambda point: float(np.sum(problem.residual(point) ** 2)),
        )
        projected = [_projected(problem, one, linear, lower, upper) for one in screened[:SEARCHES]]
        best = min(projected, key=lambda point: float(np.sum(problem.residual(point) ** 2)))
    else:
        best = with_linear_solved(problem, start, linear, lower, upper)

    def downhill(point: Array) -> Array:
        return -problem.jacobian(point)

    if not linear.all():
        best = least_squares(
            problem.residual,
            best,
            jac=downhill,
            bounds=(lower, upper),
            x_scale="jac",
        ).x
        # That search stays within its bounds, by 1e-22 or so; here a value that asks for a bound lies on it.
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
    return name in LINEAR or name.startswith("ripple")


def _projected(
    problem: InverseProblem, start: Array, linear: NDArray[np.bool_], lower: Array, upper: Array
) -> Array:
    """Return the optimum that a search over the other than `linear` parameters (p,) reaches from `start`."""
    from scipy.optimize import least_squares

    if linear.all():
        return with_linear_solved(problem, start, linear, lower, upper)
    logarithmic = np.array([name in POSITIVE for name, _ in problem.keys])[~linear]

    def point_of(searched: Array) -> Array:
        point = start.copy()
        point[~linear] = np.where(logarithmic, np.exp(searched), searched)
        return with_linear_solved(problem, point, linear, lower, upper)

    def searched_of(values: Array) -> Array:
        outer = values[~linear]
        return np.where(logarithmic, np.log(np.where(logarithmic, outer, 1.0)), outer)

    def residual_of(searched: Array) -> Array:
        return problem.residual(point_of(searched))

    found = least_squares(
        residual_of,
        searched_of(start),
        bounds=(searched_of(lower), searched_of(upper)),
        diff_step=np.full(int(np.sum(~linear)), SEARCH_STEP),
        max_nfev=MOST_STEPS,
        ftol=SEARCH_TOLERANCE,
        xtol=SEARCH_TOLERANCE,
    )
    return np.clip(point_of(found.x), lower, upper)


def with_linear_solved(
    problem: InverseProblem, point: Array, linear: NDArray[np.bool_], lower: Array, upper: Array
) -> Array:
    """Return `point` (p,) with its `linear` parameters by least squares within bounds, given the others."""
    from scipy.optimize import lsq_linear

    if not linear.any():
        return point
    columns = problem.jacobian(point, linear)
    norms = np.linalg.norm(columns, axis=0)
    # Of a column that is nearly 0, as of the static friction where it acts up to no speed, nothing is known.
    size = np.maximum(norms, max(LEAST_COLUMN * norms.max(), np.finfo(float).tiny))
    target = problem.residual(point) + columns @ point[linear]
    found = lsq_linear(columns / size, target, (lower[linear] * size, upper[linear] * size), method="bvls")
    solved = point.copy()
    # Scaling back rounds: a value on its bound would lie beyond it.
    solved[linear] = np.clip(found.x / size, lower[linear], upper[linear])
    return solved


def _starts(problem: InverseProblem) -> list[Array]:
    """Return where the search begins: at several speeds and angles where they are free, else as described."""
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
        varied = start.copy()
        varied[list(options)] = values
        starts.append(varied)
    return starts


def _bounds(problem: InverseProblem) -> tuple[Array, Array]:
    """Return the lowest and highest values (p,) that a search may reach; infinite where it is free."""
    slowest = STILL_SHARE * min(motion.still_speed for motion in problem.motions)
    fastest = max(float(np.max(np.abs(motion.speed))) for motion in problem.motions)
    shown = [measured_torque(motion, problem.described) for motion in problem.motions]
    torque = np.sqrt(np.mean([np.mean(one**2) for one in shown]))
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
