"""Filtering of the evidence on a unit: its observations and replacements in the order of hours."""

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
"""Variance of a level that a diagnosis did not estimate: such an observation has no information."""

LEAST_ERROR = 1e-3
"""Least standard error of a level: without it, the covariance of a noise-free diagnosis would be singular."""


@dataclass(frozen=True, eq=False)
class Followed:
    """The present filter state, and the filter states after selected observations."""

    belief: Belief
    past: tuple[Belief, ...] = field(repr=False)


@dataclass(frozen=True, eq=False)
class Moment:
    """Filter state after an observation, before a replacement, or now.

    `ends` (8,) is True for components that are replaced then; `observed` is True after an observation.
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
    """Return the filter states of a unit after its observations and replacements, by hours.

    `past` are the indices of the used observations after which the filter state is kept, 2 MB each; by
    default all. Errors as in `moments`.
    """
    kept: list[Belief] = []
    index = 0
    for moment in moments(evidence, prior, seed=seed, settings=settings):
        belief = moment.belief
        if moment.observed:
            if past is None or index in past:
                kept.append(belief)
            index += 1
    return Followed(belief, tuple(kept))


def moments(
    evidence: Evidence, prior: Prior, *, seed: int = 0, settings: FilterSettings = FILTER
) -> Iterator[Moment]:
    """Yield the filter states of a unit at its observations and replacements, by hours, and the present one.

    A replacement at the hours of an observation is applied after it.

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
    no_component = np.zeros(evidence.components, bool)

    def predicted_to(belief: Belief, hours: float) -> Belief:
        if prior.reference is None:
            return predicted(belief, hours)
        exposed = exposure(evidence.stresses, prior.reference, belief.hours, hours)
        return predicted(belief, hours, exposed)

    events: list[tuple[float, int, Observation | str]] = [
        *((observation.hours, 0, observation) for observation in evidence.used),
        *((hours, 1, component) for hours, component in evidence.replacements),
    ]
    for hours, _, event in sorted(events, key=lambda event: event[:2]):
        belief = predicted_to(belief, hours)
        if isinstance(event, str):
            ends = np.isin(np.arange(evidence.components), columns_of(event))
            yield Moment(belief, ends)
            belief = replaced(belief, ends)
            continue
        try:
            belief = updated(belief, event.level, _update_covariance(evidence.unit, event), settings)
        except np.linalg.LinAlgError:
            raise PrognosisError(
                f"unit '{evidence.unit}': the covariance of the diagnosis at {hours:.9g} h is not positive "
                "definite; diagnose its recording again"
            ) from None
        yield Moment(belief, no_component, observed=True)
    yield Moment(predicted_to(belief, evidence.hours), no_component)


def _update_covariance(unit: str, observation: Observation) -> Array:
    """Return the covariance (8, 8) of an observation for the update, without the shared part."""
    if not (
        observation.hours >= 0
        and np.all(np.isfinite(observation.level))
        and np.all(np.isfinite(observation.covariance))
    ):
        raise PrognosisError(
            f"unit '{unit}': the diagnosis at {observation.hours:.9g} h is not finite; "
            "diagnose its recording again"
        )
    unshared = observation.covariance - observation.shared
    covariance = unshared + LEAST_ERROR**2 * np.eye(len(observation.seen))
    not_estimated = ~observation.seen
    covariance[not_estimated, :] = covariance[:, not_estimated] = 0.0
    covariance[not_estimated, not_estimated] = UNSEEN_VARIANCE
    return covariance
