"""Laws that hide where the estimate without them passes for explained: a score test finds them.

A torque constant that falls with the current reads as small shorts, an eccentricity, a friction below healthy
or another inertia; voltage that the inverter takes, as another inertia or scale. What these leave is no more
than noise and switching, but it has a direction of its own (Rao 1948). Where that shows, the whole search is
repeated with the law.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.baseline import SIGNED
from emaphm.actuator.laws import LAWS
from emaphm.diagnosis.selection.law_selection import fit_with_law, is_possible, with_law
from emaphm.diagnosis.selection.sensor_error_scores import regressed_error
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.methods import Method
from emaphm.estimation.parameter_variation import varied
from emaphm.estimation.reference.refinement import refine_by_reference
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.local_covariance import jacobians_at
from emaphm.random_streams import child_seed, stream


@dataclass(frozen=True)
class HiddenLaw:
    """A law with one parameter, and when it is suspected.

    The derivative by the parameter is taken between two `ends` of its coordinate. Its size is relative to
    what `scale` returns of an actuator; one below `least` makes up for nothing that matters.
    """

    name: str
    ends: tuple[float, float]
    scale: Callable[[Actuator], float]
    least: float


HIDDEN = (
    HiddenLaw("saturation", (-0.1, 0.1), lambda actuator: 1 / actuator.controller.current_limit, 0.02),
    HiddenLaw(
        "inverter-drop",
        (-3.0, 0.0),
        lambda actuator: actuator.electrical.supply if actuator.electrical else 1.0,
        0.002,
    ),
)
"""Shares of the torque constant at the current limit, and of the supply."""


@dataclass(frozen=True)
class HiddenLawSettings:
    """When a law is suspected, by the score test.

    By a score above `score` standard errors, where the data determine it to `informative` times the least
    size that matters. Of 79 recordings without a saturation, with random faults and loads, 7 had a larger
    score, and none a size above 0.013. Where another plant's torque constant fell by 0.5 or 1 % per ampere
    (11 and 22 % at the limit) and small faults made up for it, scores were 15 to 45, of sizes from 0.11 to
    0.26.
    """

    score: float = 2.0
    informative: float = 2.5


SETTINGS = HiddenLawSettings()


@dataclass(frozen=True)
class Score:
    """What the linear model makes of a law's parameter, relative to its scale, and the standard error."""

    size: float
    error: float


def suspected_laws(result: SearchResult, seed: int) -> list[str]:
    """Return the hidden laws that the residual of an estimate without them shows."""
    suspected = []
    for law in HIDDEN:
        if not is_possible(result.objective.problem.actuator, LAWS[law.name]):
            continue
        score = score_of(law, result, seed)
        signed = LAWS[law.name].parameters[0] in SIGNED
        size = abs(score.size) if signed else score.size
        known = score.error < SETTINGS.informative * law.least
        if known and size > max(law.least, SETTINGS.score * score.error):
            suspected.append(law.name)
    return suspected


def score_of(law: HiddenLaw, result: SearchResult, seed: int) -> Score:
    """Return the size of the parameter of `law` at an estimate without it, all other parameters free."""
    objective, jacobians = result.objective, result.jacobians
    if jacobians is None:
        jacobians = jacobians_at(objective, result.point, stream(seed, "Jacobians of the hidden laws"))
    extended = with_law(objective, LAWS[law.name])
    points = np.tile(extended.space.carried_over(result.point, objective.space), (2, 1))
    points[:, -1] = law.ends
    actuator, unit = extended.problem.actuator, float(extended.space.nuisances.unit.axes[-1, -1])
    values = varied(actuator, LAWS[law.name].parameters[0], unit * np.array(law.ends)) / law.scale(actuator)
    low, high = extended.outputs(points)[:, : objective.channel_rows]
    derivative = (high - low) / float(values[1] - values[0])
    residual = result.residual[: objective.channel_rows]
    _, size, error = regressed_error(jacobians.mean(axis=0), derivative, residual, objective.problem)
    return Score(size, error)


def with_hidden_law(
    searched: SearchResult, name: str, method: Method, max_corrections: int, seed: int
) -> SearchResult:
    """Return the estimate with the law, from that `searched` without it."""
    child = child_seed(seed, "hidden law", name)
    fit = fit_with_law(searched, LAWS[name], method, child)
    return refine_by_reference(correct_bias(fit.objective, fit.points, max_corrections, child), child)
