"""What the reference model leaves of a recording with each of several supplies, the other parameters held.

A supply acts on a drive that keeps its currents within a hysteresis band by the switching alone. The averaged
model has hardly a derivative for it, so that neither a search nor a score test sees a wrong one. In the
reference model the ripple shows it: only within some 4 % of the true supply does it follow the recorded one.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.diagnosis.selection.ripple import RippleResidual, ripple_powers
from emaphm.diagnosis.selection.settings import SELECTION
from emaphm.estimation.bias_correction import compared
from emaphm.estimation.discrepancy import REFERENCE_RUNS, reference_problem
from emaphm.estimation.objective import CORRELATED_ROWS, MapObjective
from emaphm.estimation.problem import Problem
from emaphm.estimation.space.nuisances import Located, usual_deviation
from emaphm.random_streams import stream

SUPPLY = "supply"


@dataclass(frozen=True)
class SupplyScanSettings:
    """Which supplies are tried, and what is made of them; `make study` (limits, supply) measures it.

    Values lie `step` apart, half of what the ripple discerns, up to `reach` standard deviations of the prior
    either way, `most` values at most. Each has `runs` of the reference model at least. The described supply
    is right where far ones leave more than `far_share` of its weighted residual: they left 1.05 to 3 in 17 of
    20 recordings with the supply as described, in 1 of 80 with one 5 or 10 % off. Another is worth trying
    that leaves less than `tried_share`: the true one left 0.6 to 0.95. A value that is not `certain` standard
    deviations off is asked for a second time. After a correction with it, it is looked for anew, up to
    `corrections` times, and kept if it is certain.
    """

    step: float = 0.02
    reach: float = 2.4
    most: int = 10
    runs: int = 4
    far_share: float = 1.05
    tried_share: float = 0.97
    corrections: int = 2
    certain: float = 2.0


SUPPLY_SCAN = SupplyScanSettings()


@dataclass(frozen=True, eq=False)
class SupplyProfile:
    """Relative `deviations` (n,) of the supply, the described first, and `powers` (n,) of the residual.

    `prior` is the standard deviation of the description's, `rows` those of the residual.
    """

    deviations: Array
    powers: Array
    prior: float
    rows: int

    @property
    def shares(self) -> Array:
        """The residual's power relative to that of the described supply, (n,)."""
        return np.asarray(self.powers / self.powers[0])

    @property
    def located(self) -> tuple[Located, float]:
        """The most probable deviation with its standard deviation, and its share of the residual.

        The mean of it and the two next to it, by probability: the supply may lie between. `CORRELATED_ROWS`
        of the rows count as one.
        """
        levels = self.rows / CORRELATED_ROWS * np.log(self.powers) + (self.deviations / self.prior) ** 2
        best = int(np.argmin(levels))
        weights = np.exp((levels[best] - levels) / 2)
        around = np.abs(self.deviations - self.deviations[best]) < 1.5 * SUPPLY_SCAN.step
        value = float(weights[around] @ self.deviations[around] / weights[around].sum())
        variance = float(weights @ (self.deviations - value) ** 2 / weights.sum()) + SUPPLY_SCAN.step**2 / 12
        return Located(value, variance**0.5), float(self.shares[best])

    @property
    def promising(self) -> bool:
        """Whether another supply than the described one leaves less, by more than every actuator deviates."""
        located, share = self.located
        off = abs(located.value) > SELECTION.least_deviation * self.prior
        return off and share < SUPPLY_SCAN.tried_share

    def with_another(self, other: Self) -> Self:
        """Return the mean of two profiles of the same supplies."""
        return replace(self, powers=(self.powers + other.powers) / 2)


def supply_profile(
    objective: MapObjective, start: Array, noise: float, seed: int, *, thorough: bool
) -> SupplyProfile:
    """Return what `objective`, of which the supply is a coordinate, leaves at `start` (d,) with each supply.

    Only with far supplies where these are clearly worse than the described one, unless `thorough`. `noise`
    is the rms of the measured channel's.
    """
    prior = usual_deviation(objective.problem.actuator, SUPPLY)
    rng, reference = stream(seed, "reference runs of a supply scan"), reference_problem(objective)
    first, others = _steps(prior)

    def outcomes_of(deviations: Array) -> list[RippleResidual]:
        return _at_supplies(objective, start, deviations, reference, rng)

    def profile_of(deviations: Array) -> SupplyProfile:
        return SupplyProfile(deviations, ripple_powers(outcomes, noise), prior, objective.problem.samples)

    outcomes = outcomes_of(first)
    profile = profile_of(first)
    if not thorough and np.all(profile.shares[1:] > SUPPLY_SCAN.far_share):
        return profile
    outcomes += outcomes_of(others)
    return profile_of(np.concatenate([first, others]))


def first_supplies(actuator: Actuator) -> Array:
    """Return the relative deviations (n,) of the supply that are tried first, described ones before."""
    return _steps(usual_deviation(actuator, SUPPLY))[0]


def _steps(prior: float) -> tuple[Array, Array]:
    """Return the described supply and some that are far from it, and all others that are tried."""
    settings = SUPPLY_SCAN
    most = min(settings.most, int(settings.reach * prior / settings.step + 1e-9))
    half = (most + 1) // 2
    first = list(dict.fromkeys((0, -half, half, most)))
    others = [step for step in range(-most, most + 1) if step not in first]
    return settings.step * np.array(first, float), settings.step * np.array(others, float)


def _at_supplies(
    objective: MapObjective, start: Array, deviations: Array, reference: Problem, rng: np.random.Generator
) -> list[RippleResidual]:
    """Return the outcomes at `start` (d,) with supplies off by `deviations` (n,)."""
    points = np.tile(start, (len(deviations), 1))
    points[:, column_of(objective)] = deviations / unit_of_supply(objective)
    none, together = np.zeros_like(objective.target), REFERENCE_RUNS // SUPPLY_SCAN.runs
    outcomes: list[RippleResidual] = []
    for k in range(0, len(points), together):
        batch = points[k : k + together]
        outcomes += [RippleResidual.of(one) for one in compared(objective, none, batch, reference, rng)]
    return outcomes


def column_of(objective: MapObjective) -> int:
    """Return the supply's place among the coordinates."""
    return objective.space.coordinates.index(SUPPLY)


def unit_of_supply(objective: MapObjective) -> float:
    """Return what a unit of the supply's coordinate is, relative."""
    nuisances = objective.space.nuisances
    i = nuisances.names.index(SUPPLY)
    return float(nuisances.meaning[i, i])
