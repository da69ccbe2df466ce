"""The filter's way through what a history says of a unit: one observation or replacement after the other."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import PrognosisError
from emaphm.prognosis.belief import Belief
from emaphm.prognosis.columns import columns_of
from emaphm.prognosis.evidence import Evidence, Observation
from emaphm.prognosis.filter.degradation import predicted, replaced, updated
from emaphm.prognosis.laws import Mask
from emaphm.prognosis.prior import Prior
from emaphm.prognosis.settings import FILTER, FilterSettings
from emaphm.prognosis.stress import StressReference, exposure

UNSEEN_VARIANCE = 1e6
"""Of a level that a diagnosis could not see: such an observation says nothing."""

LEAST_ERROR = 1e-3
"""Standard error that a level has at least: a diagnosis without noise would leave its covariance singular."""


@dataclass(frozen=True, eq=False)
class Followed:
    """The belief now, and those at the hours of the observations of which they were to be kept."""

    belief: Belief
    past: tuple[Belief, ...] = field(repr=False)


@dataclass(frozen=True, eq=False)
class Moment:
    """What is believed after an observation, before components are replaced, or now.

    `ends` says which components are replaced then, (8,); `observed` whether there was an observation.
    """

    belief: Belief
    ends: Mask
    observed: bool = False


def follow(
    evidence: Evidence,
    prior: Prior,
    *,
    seed: int = 0,
    settings: FilterSettings = FILTER,
    past: Collection[int] | None = None,
) -> Followed:
    """Return what is believed of a unit after its observations and replacements, by hours.

    `past` are the numbers of the used observations after which the belief is kept, 2 MB each; all where left
    out. Errors as in `moments`.
    """
    kept: list[Belief] = []
    number = 0
    for moment in moments(evidence, prior, seed=seed, settings=settings):
        belief = moment.belief
        if moment.observed:
            if past is None or number in past:
                kept.append(belief)
            number += 1
    return Followed(belief, tuple(kept))


def moments(
    evidence: Evidence, prior: Prior, *, seed: int = 0, settings: FilterSettings = FILTER
) -> Iterator[Moment]:
    """Yield what is believed of a unit at its observations and replacements, by hours, and at last now.

    A replacement at the hours of an observation comes after it.

    Raises
    ------
    PrognosisError
        An observation is not finite, its hours are below 0, or its covariance is not positive definite.
    """
    if prior.reference is None:
        prior = replace(prior, reference=StressReference.of(evidence.stresses))
    belief = Belief.new(
        prior, seed=seed, settings=settings, components=evidence.components, shared=evidence.shared
    )
    none = np.zeros(evidence.components, bool)

    def later(belief: Belief, hours: float) -> Belief:
        if prior.reference is None:
            return predicted(belief, hours)
        exposed = exposure(evidence.stresses, prior.reference, belief.hours, hours)
        return predicted(belief, hours, exposed)

    events: list[tuple[float, int, Observation | str]] = [
        *((one.hours, 0, one) for one in evidence.used),
        *((hours, 1, component) for hours, component in evidence.replacements),
    ]
    for hours, _, event in sorted(events, key=lambda one: one[:2]):
        belief = later(belief, hours)
        if isinstance(event, str):
            ends = np.isin(np.arange(evidence.components), columns_of(event))
            yield Moment(belief, ends)
            belief = replaced(belief, ends)
            continue
        try:
            belief = updated(belief, event.level, _usable(evidence.unit, event), settings)
        except np.linalg.LinAlgError:
            raise PrognosisError(
                f"unit '{evidence.unit}': the covariance of the diagnosis at {hours:.9g} h is not positive "
                "definite; diagnose its recording again"
            ) from None
        yield Moment(belief, none, observed=True)
    yield Moment(later(belief, evidence.hours), none)


def _usable(unit: str, observation: Observation) -> Array:
    """Return the covariance to update with, (8, 8)."""
    if not (
        observation.hours >= 0
        and np.all(np.isfinite(observation.level))
        and np.all(np.isfinite(observation.covariance))
    ):
        raise PrognosisError(
            f"unit '{unit}': the diagnosis at {observation.hours:.9g} h is not finite; "
            "diagnose its recording again"
        )
    own = observation.covariance - observation.shared
    covariance = own + LEAST_ERROR**2 * np.eye(len(observation.seen))
    hidden = ~observation.seen
    covariance[hidden, :] = covariance[:, hidden] = 0.0
    covariance[hidden, hidden] = UNSEEN_VARIANCE
    return covariance
