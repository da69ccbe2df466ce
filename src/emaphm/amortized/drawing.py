"""What an estimator learns from: faults and nuisances, drawn before any recording.

The prior is a mixture of three kinds of actuators, because an estimator is good where it has seen many:

- *any*: every component anywhere in its range, shorts up to `any_short`;
- *heavy*: the same with every phase shorted by a share within `heavy_short`;
- *slight*: components gathered near healthy, k = u^`gathering` of an even u: half of them are below 5 %.

Of a share of all, the friction is below healthy. Nuisances, and what the unit's baseline leaves open, have
their own normal priors (`emaphm.estimation.nuisances`).
"""

from dataclasses import dataclass

import numpy as np

from emaphm.actuator.faults import HEALTHY, NAMES
from emaphm.arrays import Array
from emaphm.estimation.parameter_space import ParameterSpace


@dataclass(frozen=True)
class PriorSettings:
    """Shares of the kinds, and their ranges, in the components' unit [0, 1].

    `any_share` and `heavy_share` of the draws are of these kinds, the rest is slight. `low_friction` is the
    share of all whose friction is below healthy. `emaphm train --help` names none of them: one prior for all
    estimators, stated in each file.
    """

    any_share: float = 0.6
    heavy_share: float = 0.15
    any_short: float = 0.75
    heavy_short: tuple[float, float] = (0.4, 0.9)
    gathering: float = 4.0
    low_friction: float = 0.1


PRIOR = PriorSettings()

SHORTS = slice(2, 5)
PHASE, GAIN = NAMES.index("eccentricity_phase"), NAMES.index("gain")


def draw(
    space: ParameterSpace, count: int, rng: np.random.Generator, settings: PriorSettings = PRIOR
) -> Array:
    """Return `count` points (count, d) of `space`, drawn from the prior."""
    even = rng.random((count, len(NAMES)))
    kind = rng.random(count)
    signs = np.where(rng.random(count) < 0.5, -1.0, 1.0)
    heavy = kind > 1 - settings.heavy_share
    slight = ~heavy & (kind > settings.any_share)
    faults = even.copy()
    faults[:, SHORTS] *= settings.any_short
    low, high = settings.heavy_short
    faults[heavy, SHORTS] = low + (high - low) * even[heavy, SHORTS]
    gathered = even[slight] ** settings.gathering
    # A direction is neither small nor large, and a gain may be on either side of healthy.
    gathered[:, PHASE] = even[slight, PHASE]
    gathered[:, GAIN] = HEALTHY.gain + 0.5 * signs[slight] * gathered[:, GAIN]
    faults[slight] = gathered
    below = rng.random(count) < settings.low_friction
    faults[below, 0] *= space.limits("friction")[0]
    points = space.points(faults)
    nuisances = space.nuisances
    drawn = nuisances.priors * rng.normal(size=(count, len(nuisances.names)))
    points[:, len(space.columns) :] = np.clip(drawn, -nuisances.widest, nuisances.widest)
    return np.asarray(points)
