"""Search of a joint fit: starts about the description, descents, and weights from the residuals."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.joint.objective import JointObjective
from emaphm.estimation.levenberg_marquardt import LeastSquaresSettings, descend
from emaphm.estimation.space.parameter_variation import start_widths
from emaphm.optimizers import space_filling
from emaphm.progress import Progress
from emaphm.random_streams import child_seed

DESCENT = LeastSquaresSettings(step=2e-3, iterations=20, least_gain=1e-6)
"""Fine steps to a small gain: there are no wrong local minima near the parameters of a healthy unit."""


@dataclass(frozen=True)
class UnitSearchSettings:
    """Settings of the search for a healthy unit's parameters; `examples/emps` shows it on a real machine.

    The best `refined_starts` of `starts` points within a factor 3 of the description are refined. Costs
    within the factor `equal_costs` count as equal, because kinks alone change them by some percent; of points
    of equal cost, the point nearest to the description is taken. Then the channels are weighted by their
    residuals, in `reweightings` further descents.
    """

    starts: int = 15
    refined_starts: int = 3
    equal_costs: float = 1.05
    reweightings: int = 3
    descent: LeastSquaresSettings = DESCENT


SEARCH = UnitSearchSettings()


def search(
    joint: JointObjective, seed: int, given: Sequence[Array] = (), on_progress: Progress | None = None
) -> tuple[JointObjective, Array]:
    """Return the objective with weights from its residuals, and its minimum (d,).

    `given` are additional starting points (p,) in the shared coordinates.
    """
    point = _multistart(joint, seed, given, on_progress)
    return settle(joint, point)


def settle(joint: JointObjective, point: Array) -> tuple[JointObjective, Array]:
    """Return the objective weighted by its residuals, and its minimum (d,) near `point`."""
    for _ in range(SEARCH.reweightings):
        joint = joint.reweighted(joint.residuals(point), [not term.correction.any() for term in joint.terms])
        point = descend(joint, point[np.newaxis], joint.box, SEARCH.descent).best
    return joint, point


def _multistart(
    joint: JointObjective, seed: int, given: Sequence[Array], on_progress: Progress | None
) -> Array:
    """Return the best point (d,) of descents from the description, points about it and `given` points."""
    shared = joint.shared
    around = start_widths(joint.unit.parameters)
    starts = np.zeros((1 + SEARCH.starts, joint.box.lower.size))
    starts[1:, :shared] = space_filling(SEARCH.starts, -around, around, child_seed(seed, "starts"))
    always = [0]
    for start in given:
        starts = np.vstack([starts, np.zeros_like(starts[:1])])
        starts[-1, :shared] = start
        always.append(len(starts) - 1)
    starts = joint.box.project(starts)
    costs = np.array([evaluation.cost for evaluation in joint.evaluate(starts)])
    best = np.unique([*always, *np.argsort(costs, kind="stable")[: SEARCH.refined_starts]])
    ends = descend(joint, starts[best], joint.box, SEARCH.descent, _iteration_callback(on_progress))
    # For parameters that the recordings do not determine, the description is the most likely value.
    equal = ends.points[ends.costs <= SEARCH.equal_costs * ends.costs.min()]
    return np.asarray(equal[np.argmin(np.linalg.norm(equal[:, :shared], axis=1))])


def _iteration_callback(on_progress: Progress | None) -> Callable[[int], None] | None:
    """Return a callback for the number of finished iterations that reports the progress."""
    iterations = SEARCH.descent.iterations
    return None if on_progress is None else lambda i: on_progress(i / iterations)
