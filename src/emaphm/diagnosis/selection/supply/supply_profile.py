"""Residual of the reference model for several supplies, with all other parameters fixed.

With a drive that keeps its currents within a hysteresis band, the supply acts through the switching alone.
The averaged model has hardly any derivative with respect to it, so that neither a search nor a score test
detects a wrong supply. The ripple of the reference model does: it follows the recorded ripple only within
some 4 % of the true supply.
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
    """Supplies that are tried, and limits of the residual; `make study` (limits, supply) measures the effect.

    Values are `step` apart, half of the resolution of the ripple, up to `reach` standard deviations of the
    prior on both sides, at most `most` values per side, with at least `runs` runs of the reference model
    each. The described supply is taken as right if far supplies have more than `far_share` of its weighted
    residual: they had 1.05 to 3 in 17 of 20 recordings with the supply as described, and in 1 of 80 with a
    supply 5 or 10 % off. Another supply is tried if it has less than `tried_share`: the true one had 0.6 to
    0.95. If the deviation is less than `certain` standard deviations, the scan is repeated. After a
    correction with the supply, it is scanned again, up to `corrections` times, and kept if its deviation is
    certain.
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
    """Relative `deviations` (n,) of the supply, first the described one, and `powers` (n,) of the residual.

    `prior` is the standard deviation of the described prior, `rows` the number of rows of the residual.
    """

    deviations: Array
    powers: Array
    prior: float
    rows: int

    @property
    def shares(self) -> Array:
        """The power of the residual relative to that with the described supply, (n,)."""
        return np.asarray(self.powers / self.powers[0])

    @property
    def located(self) -> tuple[Located, float]:
        """The estimated deviation with its standard deviation, and the share of the residual.

        The estimate is the mean, weighted by probability, of the most probable deviation and the two next to
        it. `CORRELATED_ROWS` rows count as one.
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
        """Whether the residual is smaller with another supply, and its deviation larger than usual."""
        located, share = self.located
        is_deviating = abs(located.value) > SELECTION.least_deviation * self.prior
        return is_deviating and share < SUPPLY_SCAN.tried_share

    def with_another(self, other: Self) -> Self:
        """Return the mean of two profiles of the same supplies."""
        return replace(self, powers=(self.powers + other.powers) / 2)


def supply_profile(
    objective: MapObjective, start: Array, noise: float, seed: int, *, thorough: bool
) -> SupplyProfile:
    """Return the profile of the supply, a coordinate of `objective`, at `start` (d,).

    Unless `thorough`, the scan ends with the far supplies if these are clearly worse than the described one.
    `noise` is the rms of the noise of the measured channel.
    """
    prior = usual_deviation(objective.problem.actuator, SUPPLY)
    rng, reference = stream(seed, "reference runs of a supply scan"), reference_problem(objective)
    first, further = _scanned_deviations(prior)

    def outcomes_of(deviations: Array) -> list[RippleResidual]:
        return _residuals_at(objective, start, deviations, reference, rng)

    def profile_of(deviations: Array) -> SupplyProfile:
        return SupplyProfile(deviations, ripple_powers(outcomes, noise), prior, objective.problem.samples)

    outcomes = outcomes_of(first)
    profile = profile_of(first)
    if not thorough and np.all(profile.shares[1:] > SUPPLY_SCAN.far_share):
        return profile
    outcomes += outcomes_of(further)
    return profile_of(np.concatenate([first, further]))


def first_supplies(actuator: Actuator) -> Array:
    """Return the relative deviations (n,) of the supply that are tried first; the first of them is 0."""
    return _scanned_deviations(usual_deviation(actuator, SUPPLY))[0]


def _scanned_deviations(prior: float) -> tuple[Array, Array]:
    """Return the deviations that are tried first, 0 and far ones, and all others."""
    settings = SUPPLY_SCAN
    largest = min(settings.most, int(settings.reach * prior / settings.step + 1e-9))
    half = (largest + 1) // 2
    first = list(dict.fromkeys((0, -half, half, largest)))
    others = [step for step in range(-largest, largest + 1) if step not in first]
    return settings.step * np.array(first, float), settings.step * np.array(others, float)


def _residuals_at(
    objective: MapObjective, start: Array, deviations: Array, reference: Problem, rng: np.random.Generator
) -> list[RippleResidual]:
    """Return the residuals at `start` (d,) with `deviations` (n,) of the supply."""
    points = np.tile(start, (len(deviations), 1))
    points[:, column_of(objective)] = deviations / unit_of_supply(objective)
    batch_size = REFERENCE_RUNS // SUPPLY_SCAN.runs
    outcomes: list[RippleResidual] = []
    for k in range(0, len(points), batch_size):
        batch = points[k : k + batch_size]
        outcomes += [RippleResidual.of(outcome) for outcome in compared(objective, batch, reference, rng)]
    return outcomes


def column_of(objective: MapObjective) -> int:
    """Return the index of the supply among the coordinates."""
    return objective.space.coordinates.index(SUPPLY)


def unit_of_supply(objective: MapObjective) -> float:
    """Return the relative deviation of the supply per unit of its coordinate."""
    nuisances = objective.space.nuisances
    i = nuisances.names.index(SUPPLY)
    return float(nuisances.meaning[i, i])
