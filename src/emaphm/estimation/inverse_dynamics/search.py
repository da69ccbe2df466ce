"""Variable projection: linear least squares inside, a search over the other parameters outside."""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.estimation.inverse_dynamics.problem import InverseProblem

LINEAR = ("inertia", "viscous", "quadratic", "coulomb", "static", "offset", "hinge", "gravity")
"""Parameters that the torque balance is linear in, beside the torque ripple's."""

LOADS = ("load_motor", "load_external", "stribeck_load_motor", "stribeck_load_external")
"""Parameters that it is not linear in, by the absolute value of a sum; and none is negative."""

SPEEDS = ("stribeck_speed", "transition_speed")
"""Parameters that the search starts at several values of."""

SPEED_STARTS = (0.01, 0.05, 0.25)
"""Where the search for them starts, relative to the rms speed."""

LOAD_START = 0.1
"""Load-dependent friction that a search begins at, where the description has none [-]."""

POSITIVE = (*SPEEDS, "torque_constant", "resistance")
"""Parameters that are searched in their logarithm."""

LOAD_BOUNDS = (1e-6, 2.0)
"""Load-dependent friction that a search may reach: at 1, no torque moves the shaft; at 0, an absolute value
has no derivative [-]."""

WIDEST = 100.0
"""Factor by which a torque constant or resistance may differ from its description."""

STILL_SHARE = 0.1
"""Slowest Stribeck or transition speed, relative to the speed that counts as still."""

SEARCH_STEP = 1e-3
"""Step of the outer search's differences, relative."""

MOST_STEPS = 30
"""Steps of an outer search; the last search over all parameters goes on from there."""

LARGEST_ASYMMETRY = 0.95
"""Beyond, one direction would have no friction."""

AT_BOUND = 1e-3
"""Distance to a bound, relative to the width of the search, that counts as lying on it."""


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
    candidates = _starts(problem) if start is None else [start]
    projected = [_projected(problem, one, linear, lower, upper) for one in candidates]
    best = min(projected, key=lambda point: float(np.sum(problem.residual(point) ** 2)))

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
    width = upper - lower
    near = np.isfinite(width) & (np.minimum(best - lower, upper - best) < AT_BOUND * width)
    return Minimum(best, problem.jacobian(best), tuple(np.array(problem.labels)[near]))


def _is_linear(name: str) -> bool:
    return name in LINEAR or name.startswith("ripple")


def _projected(
    problem: InverseProblem, start: Array, linear: NDArray[np.bool_], lower: Array, upper: Array
) -> Array:
    """Return the optimum that a search over the other than `linear` parameters (p,) reaches from `start`."""
    from scipy.optimize import least_squares

    if linear.all():
        return _solved(problem, start, linear)
    logarithmic = np.array([name in POSITIVE for name, _ in problem.keys])[~linear]

    def point_of(searched: Array) -> Array:
        point = start.copy()
        point[~linear] = np.where(logarithmic, np.exp(searched), searched)
        return _solved(problem, point, linear)

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
    )
    return np.clip(point_of(found.x), lower, upper)


def _solved(problem: InverseProblem, point: Array, linear: NDArray[np.bool_]) -> Array:
    """Return `point` (p,) with its `linear` parameters by least squares, given the others."""
    if not linear.any():
        return point
    columns = problem.jacobian(point, linear)
    size = np.maximum(np.linalg.norm(columns, axis=0), np.finfo(float).tiny)
    step = np.linalg.lstsq(columns / size, problem.residual(point), rcond=None)[0] / size
    solved = point.copy()
    solved[linear] += step
    return solved


def _starts(problem: InverseProblem) -> list[Array]:
    """Return where the search begins: several speeds of the laws that have one, else the description."""
    start = problem.start
    names = [name for name, _ in problem.keys]
    for k, name in enumerate(names):
        if name in LOADS and start[k] == 0:
            start[k] = LOAD_START
    speed = np.sqrt(np.mean([np.mean(motion.speed**2) for motion in problem.motions]))
    places = [k for k, name in enumerate(names) if name in SPEEDS]
    starts = []
    for shares in itertools.product(SPEED_STARTS, repeat=len(places)):
        one = start.copy()
        one[places] = np.array(shares) * speed
        starts.append(one)
    return starts


def _bounds(problem: InverseProblem) -> tuple[Array, Array]:
    """Return the lowest and highest values (p,) that a search may reach; infinite where it is free."""
    slowest = STILL_SHARE * min(motion.still_speed for motion in problem.motions)
    fastest = max(float(np.max(np.abs(motion.speed))) for motion in problem.motions)
    described = problem.start
    lower, upper = np.full(described.size, -np.inf), np.full(described.size, np.inf)
    for k, (name, _) in enumerate(problem.keys):
        if name in SPEEDS:
            lower[k], upper[k] = slowest, fastest
        elif name in LOADS:
            lower[k], upper[k] = LOAD_BOUNDS
        elif name.endswith("_asymmetry"):
            lower[k], upper[k] = -LARGEST_ASYMMETRY, LARGEST_ASYMMETRY
        elif name in POSITIVE:
            lower[k], upper[k] = described[k] / WIDEST, described[k] * WIDEST
    return lower, upper
