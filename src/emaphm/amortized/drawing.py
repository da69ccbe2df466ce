"""The prior of the training set: random faults and nuisances.

The prior is a mixture of three kinds of actuators, because an estimator is accurate where its training set is
dense:

- *any*: each component uniform in its range, shorts up to `any_short`;
- *heavy*: the same, with each phase shorted by a share within `heavy_short`;
- *slight*: a share `whole` of the components is near healthy: normal about healthy, with one standard
  deviation for the actuator, uniform in `slight`; the other components are uniform in their range.

The density of the last kind has no peak at healthy, where a component has its bound. Normal distributions
truncated there can therefore describe the posterior. In a share of all draws, the friction is below healthy.
Nuisances, and the parameters that the unit's baseline leaves open, have their own normal priors
(`emaphm.estimation.space.nuisances`).
"""

from dataclasses import dataclass

import numpy as np

from emaphm.actuator.faults import HEALTHY, NAMES
from emaphm.arrays import Array
from emaphm.estimation.space.parameter_space import ParameterSpace


@dataclass(frozen=True)
class PriorSettings:
    """Shares and ranges of the three kinds of actuators, in the components' unit [0, 1].

    `any_share` and `heavy_share` are the shares of these kinds; the remaining draws are slight.
    `low_friction` is the share of all draws whose friction is below healthy. They are no options of
    `emaphm train`: all estimators have the same prior, and each file states it.
    """

    any_share: float = 0.6
    heavy_share: float = 0.15
    any_short: float = 0.75
    heavy_short: tuple[float, float] = (0.4, 0.9)
    slight: tuple[float, float] = (0.02, 0.2)
    whole: float = 0.8
    low_friction: float = 0.1


PRIOR = PriorSettings()

SHORTS = slice(2, 5)
PHASE, GAIN = NAMES.index("eccentricity_phase"), NAMES.index("gain")


def draw(space: ParameterSpace, count: int, rng: np.random.Generator) -> Array:
    """Return `count` points (count, d) of `space`, drawn from the prior."""
    even = rng.random((count, len(NAMES)))
    kind = rng.random(count)
    heavy = kind > 1 - PRIOR.heavy_share
    slight = ~heavy & (kind > PRIOR.any_share)
    faults = even.copy()
    faults[:, SHORTS] *= PRIOR.any_short
    low, high = PRIOR.heavy_short
    faults[heavy, SHORTS] = low + (high - low) * even[heavy, SHORTS]
    faults[slight] = _slight(even[slight], rng)
    below = rng.random(count) < PRIOR.low_friction
    faults[below, 0] *= space.limits("friction")[0]
    points = space.points(faults)
    nuisances = space.nuisances
    drawn = nuisances.priors * rng.normal(size=(count, len(nuisances.names)))
    points[:, len(space.columns) :] = np.clip(drawn, -nuisances.widest, nuisances.widest)
    return np.asarray(points)


def _slight(even: Array, rng: np.random.Generator) -> Array:
    """Return faults (n, 8): most of them near healthy, the others equal to `even` (n, 8)."""
    low, high = PRIOR.slight
    size = low + (high - low) * rng.random((len(even), 1))
    near = size * rng.normal(size=even.shape)
    near[:, GAIN] = HEALTHY.gain + near[:, GAIN]
    others = np.arange(len(NAMES)) != GAIN
    near[:, others] = np.abs(near[:, others])
    whole = rng.random(even.shape) < PRIOR.whole
    # The phase of the eccentricity is a direction: no value of it is near healthy.
    whole[:, PHASE] = False
    return np.asarray(np.where(whole, np.clip(near, 0.0, 1.0), even))
