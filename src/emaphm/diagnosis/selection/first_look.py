"""First look at possible deviations: one batch of the reference model decides which ones are tested further.

Inertia (`profile`), supply (`supply_scan`) and lag of the current (`sensor_lag`) are tested with a batch of
runs of the reference model each. Most actuators are as described, and fewer runs show this: the residual with
each deviation is then clearly larger than without. A single batch contains all these runs.
"""

from dataclasses import dataclass, field

import numpy as np

from emaphm.arrays import Array
from emaphm.diagnosis.selection.extension import with_nuisances
from emaphm.diagnosis.selection.laws.sensor_lag import LagComparison, answer_to_lag, can_show_lag
from emaphm.diagnosis.selection.profile import INERTIA, compared_power
from emaphm.diagnosis.selection.ripple import RippleResidual, ripple_powers
from emaphm.diagnosis.selection.supply.supply_profile import SUPPLY, column_of, first_supplies, unit_of_supply
from emaphm.estimation.bias_correction import compared
from emaphm.estimation.discrepancy import reference_problem
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.random_streams import stream


@dataclass(frozen=True)
class FirstLookSettings:
    """Limits below which a deviation is tested further; `make study` (limits) measures the effect.

    `inertia`, `supply`: ratio of the residual with another inertia, or a far supply, to that without. Of 104
    recordings with a deviation (supply 4 to 10 %, inertia 3 to 10 %, a lag of 2 to 20 µs, another scale of
    the voltage), those that the further test finds promising had ratios of at most 1.09 and 1.07 in 99 of 100
    draws of the runs. `lag`: response of the ripple to a lag (`answer_to_lag`); it was 0.12 to 0.76 in 12
    recordings without a lag, and -1.16 to 0.08 in 46 recordings with lags of 2 to 40 µs.
    """

    inertia: float = 1.1
    supply: float = 1.15
    lag: float = 0.4


FIRST_LOOK = FirstLookSettings()


@dataclass(frozen=True, eq=False)
class FirstLook:
    """Residuals with deviations, relative to the residual without them.

    `inertia` (2,): mean squared residual of all channels with a smaller and a larger inertia. `supply`: power
    of the ripple's residual with the best of some far supplies. `lag`: response of the ripple to a lag
    (`answer_to_lag`). With the defaults, for which no runs were made, all three are tested further.
    """

    inertia: Array = field(default_factory=lambda: np.zeros(2))
    supply: float = 0.0
    lag: float = 0.0

    @property
    def shows_inertia(self) -> bool:
        """Whether an inertia is tested further."""
        return bool(self.inertia.min() < FIRST_LOOK.inertia)

    @property
    def shows_supply(self) -> bool:
        """Whether a supply is tested further."""
        return self.supply < FIRST_LOOK.supply

    @property
    def shows_lag(self) -> bool:
        """Whether a lag of the current is tested further, also if its effect is below the ripple (nan)."""
        return not self.lag > FIRST_LOOK.lag


def first_look(
    result: SearchResult, names: tuple[str, ...], profiled: tuple[MapObjective, Array] | None, seed: int
) -> FirstLook:
    """Return the first look at possible deviations at `result`, whose nuisances `names` were selected before.

    `profiled` is the objective with an inertia, and points (n, d) of it on both sides of nominal; None if the
    inertia is known. No runs are made if supply or lag have no effect on the switching, or are known.
    """
    problem = result.objective.problem
    possible = result.objective.space.nuisances.others(problem.actuator, tuple(problem.measured))
    if not (can_show_lag(problem) and SUPPLY in possible):
        return FirstLook()
    added = (SUPPLY,) if profiled is None else (INERTIA, SUPPLY)
    scanned, _ = with_nuisances(result, names, added)
    comparison = LagComparison.at(scanned, result.point, result.objective.space)
    objective, space = comparison.objective, comparison.objective.space
    deviations = first_supplies(problem.actuator)[1:]
    supplies = np.tile(comparison.without, (len(deviations), 1))
    supplies[:, column_of(objective)] = deviations / unit_of_supply(objective)
    points = [comparison.without, comparison.without, comparison.with_lag, *supplies]
    if profiled is not None:
        inertias = [space.carried_over(point, profiled[0].space) for point in profiled[1]]
        points += [np.append(point[:-1], space.lower[-1]) for point in inertias]
    rng = stream(seed, "reference runs of a first look")
    outcomes = compared(objective, np.array(points), reference_problem(objective), rng)
    first_half, second_half, lagging, *with_other_supply = (
        RippleResidual.of(outcome) for outcome in outcomes[: 3 + len(supplies)]
    )
    described = first_half.together_with(second_half)
    with_supplies = ripple_powers([described, *with_other_supply], result.noise_level)
    with_lag = ripple_powers([lagging, described, lagging.less(second_half)], result.noise_level)
    all_channels = np.array([compared_power(outcome) for outcome in outcomes])
    return FirstLook(
        all_channels[3 + len(supplies) :] / all_channels[:2].mean(),
        float(np.min(with_supplies[1:], initial=np.inf) / with_supplies[0]),
        answer_to_lag(with_lag),
    )
