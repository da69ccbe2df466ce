"""The search of a joint fit: starts about the description, descents, and weights by the residuals."""

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
"""Fine steps to a flat end: parameters of a healthy unit have no false minima near."""


@dataclass(frozen=True)
class UnitSearchSettings:
    """How a healthy unit's parameters are searched; `examples/emps` shows the result on a real machine.

    The best `refined_starts` of `starts` points within a factor 3 of the description are refined. Costs
    within the factor `equal_costs` count as equal, as kinks alone make them vary by some percent; of these
    the point nearest to the description is taken. Then the channels are weighted by their residuals, in
    `reweightings` further descents.
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
    """Return the objective with weights by its residuals, and the point (d,) that minimises it.

    `given` are points of shared coordinates (p,) to start from, in addition to the description's and those
    about it.
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
    """Return the refined best (d,) of the description's values and of starts around them."""
    shared = joint.shared
    around = start_widths(joint.unit.parameters)
    starts = np.zeros((1 + SEARCH.starts, joint.box.lower.size))
    starts[1:, :shared] = space_filling(SEARCH.starts, -around, around, child_seed(seed, "starts"))
    always = [0]
    for one in given:
        starts = np.vstack([starts, np.zeros_like(starts[:1])])
        starts[-1, :shared] = one
        always.append(len(starts) - 1)
    starts = joint.box.project(starts)
    costs = np.array([one.cost for one in joint.evaluate(starts)])
    best = np.unique([*always, *np.argsort(costs, kind="stable")[: SEARCH.refined_starts]])
    found = descend(joint, starts[best], joint.box, SEARCH.descent, _iterations(on_progress))
    # What the recordings do not determine is most likely as it is described.
    equal = found.points[found.costs <= SEARCH.equal_costs * found.costs.min()]
    return np.asarray(equal[np.argmin(np.linalg.norm(equal[:, :shared], axis=1))])


def _iterations(on_progress: Progress | None) -> Callable[[int], None] | None:
    iterations = SEARCH.descent.iterations
    return None if on_progress is None else lambda i: on_progress(i / iterations)
