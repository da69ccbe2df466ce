"""Maintenance advice for a unit from the distribution of its remaining useful life, with its risk."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import PrognosisError

WIDE = 3.0
"""Ratio of the median RUL to the allowed hours above which the advice is an inspection and not a replacement:
a replacement would waste most of the life because of the uncertainty alone."""

PRIOR_ALONE = "the prior alone"
"""Source of a forecast without an explained diagnosis, as text."""

CERTAIN = 0.95
"""Probability from which on a violation is stated as a fact."""

UNRESOLVED = 3
"""Number of failures of the sample up to the cheapest time, up to which the sample does not resolve this
time: the relative standard error of the probability of failure until the k-th failure is 1/sqrt(k)."""


@dataclass(frozen=True)
class Costs:
    """Costs of a failure with its consequences and of a planned replacement; any currency, above 0.

    Raises
    ------
    PrognosisError
        A cost is not above 0, or a failure costs no more than a replacement.
    """

    failure: float
    replacement: float

    def __post_init__(self) -> None:
        for name, cost in (("failure", self.failure), ("replacement", self.replacement)):
            if not 0 < cost < math.inf:
                raise PrognosisError(f"the cost of a {name}, {cost:g}, is not a cost; give a number above 0")
        if self.failure <= self.replacement:
            raise PrognosisError(
                f"a failure costs {self.failure:g}, not more than a replacement at {self.replacement:g}: "
                "replacing before the failure has no advantage; give the cost of a failure with its "
                "consequences"
            )


@dataclass(frozen=True)
class Advice:
    """Action ("fly on", "inspect by" or "replace before"), its hours from now on [h], risk and reason.

    `risk` is the probability of failure until then; for 0 h, the probability that the unit has already
    failed.
    """

    action: str
    hours: float
    risk: float
    reason: str

    @property
    def replaces_now(self) -> bool:
        """Whether the unit is to be replaced before any further flight."""
        return self.action == "replace before" and self.hours == 0

    def to_dict(self, now: float) -> dict[str, Any]:
        """Return the advice as JSON; `now` are the unit's current flight hours [h]."""
        return {
            "action": self.action,
            "in_hours": self.hours,
            "at_hours": now + self.hours,
            "risk": self.risk,
            "reason": self.reason,
        }


def advice_in_words(given: Mapping[str, Any]) -> str:
    """Return action, hours from now on and flight hours as text, from advice as in `Advice.to_dict`."""
    span, until = f"{given['in_hours']:,.0f} h", f"{given['at_hours']:,.0f} h"
    if given["action"] == "fly on":
        return f"fly on for {span} more, until {until}"
    verb, end = given["action"].split()
    return f"{verb} within {span}, {end} {until}" if given["in_hours"] else f"{verb} now"


def advice(
    sample: Array, horizon: float, *, risk: float, age: float = 0.0, costs: Costs | None = None
) -> Advice:
    """Return the advice for a sample of the RUL.

    Without costs, the allowed hours are those until which the probability of failure is at most `risk`. With
    costs, they minimise the cost per hour (age replacement [1]): they are the t that minimises

        (c_r (1 - F(t)) + c_f F(t)) / (a + E[min(RUL, t)]).

    At the k-th of n failures, F has the distribution Beta(k, n + 1 - k) for any distribution of the RUL [2].
    With costs, its mean k / (n + 1) is used and stated as the risk; the share (k - 1) / n would be 0 for the
    first failure. The reason states if the sample does not resolve the risk or the costs.

    Parameters
    ----------
    sample
        Sample of the RUL [h], (n,), `inf` without a failure in sight.
    horizon
        Planned flight hours from now on [h].
    risk
        Largest accepted probability of failure.
    age
        a, hours that the unit has flown since its last replacement [h].

    References
    ----------
    [1] Barlow, Hunter: Optimum preventive maintenance policies, Operations Research 8 (1960).
    [2] David, Nagaraja: Order Statistics, 3rd edition (2003).
    """
    ordered = np.sort(np.asarray(sample, float))
    failed = float(np.mean(ordered == 0))
    if ordered[int(0.5 * (ordered.size - 1))] == 0:
        return Advice("replace before", 0.0, failed, f"a requirement is {violated_in_words(failed)}")
    limit, why = _until_risk(ordered, risk) if costs is None else _until_costs(ordered, age, costs)
    if limit >= horizon:
        when = "beyond the horizon" if math.isfinite(limit) else "nowhere in the forecast"
        return Advice("fly on", horizon, float(np.mean(ordered < horizon)), f"{why} {when}")
    before = int(np.sum(ordered < limit))
    until = max(before / ordered.size if costs is None else (before + 1) / (ordered.size + 1), failed)
    when = "then" if limit > 0 else f"now: a requirement is {violated_in_words(failed)}"
    if ordered[(ordered.size - 1) // 2] > WIDE * limit:
        lasting = "although the unit may well last longer: diagnose again"
        return Advice("inspect by", limit, until, f"{why} {when}, {lasting}")
    return Advice("replace before", limit, until, f"{why} {when}")


def violated_in_words(probability: float) -> str:
    """Return "violated already" as text, with its `probability` if it is below `CERTAIN`."""
    if probability >= CERTAIN:
        return "violated already"
    return f"violated already with a probability of {100 * probability:.3g} %"


def _until_risk(ordered: Array, risk: float) -> tuple[float, str]:
    """Return the hours until which the risk is at most `risk` [h], and the reason as text."""
    allowed = math.floor(risk * ordered.size + 1e-9)
    why = f"the risk exceeds {100 * risk:g} %"
    if not allowed:
        why = f"the first of {ordered.size} paths, too few for a risk of {100 * risk:g} %, fails"
    return float(ordered[min(allowed, ordered.size - 1)]), why


def _until_costs(ordered: Array, age: float, costs: Costs) -> tuple[float, str]:
    """Return the hours with the lowest cost per hour [h], and the reason as text."""
    why = "a replacement is cheaper"
    finite = ordered[np.isfinite(ordered)]
    if not finite.size:
        return math.inf, why
    # Candidates are the times just before a failure of the sample: between failures, the cost per hour falls.
    candidates = np.unique(finite)
    failed = (np.searchsorted(ordered, candidates, "left") + 1) / (ordered.size + 1)
    flown = np.array([np.minimum(ordered, candidate).mean() for candidate in candidates])
    rates = (costs.replacement * (1 - failed) + costs.failure * failed) / (age + flown + 1e-9)
    best = int(np.argmin(rates))
    never = costs.failure * (finite.size + 1) / (ordered.size + 1) / (age + flown[-1] + 1e-9)
    # The relative standard error of a cost from n paths is 1/sqrt(n). If the hazard does not increase, the
    # minimum is at the last failures of the sample, and lower by less than this error.
    if rates[best] >= never * (1 - 1 / math.sqrt(ordered.size)):
        return math.inf, why
    failures_until = int(np.searchsorted(ordered, candidates[best], "right"))
    if failures_until <= UNRESOLVED:
        first = "first" if failures_until == 1 else f"first {failures_until}"
        why = f"by the {first} of {ordered.size} paths, too few for so small a risk, {why}"
    return float(candidates[best]), why


def without_observed_violation(given: Advice, newest: float | None) -> Advice:
    """Return the advice for a unit of which no diagnosis shows a violation: inspect instead of replace now.

    Over long hours without a diagnosis, the prior alone makes a violation likely. A recording costs less than
    a replacement, and shows whether there is one. Other advice, and a certain violation, are not changed.

    Parameters
    ----------
    given
        The advice according to the forecast.
    newest
        Flight hours of the newest explained diagnosis [h], None without any.
    """
    if not given.replaces_now or (given.risk >= CERTAIN and newest is not None):
        return given
    source = PRIOR_ALONE if newest is None else f"the forecast from the diagnosis of {newest:.9g} h"
    return Advice(
        "inspect by",
        0.0,
        given.risk,
        f"according to {source}, a requirement is {violated_in_words(given.risk)}; no diagnosis shows it: "
        "record again",
    )


def without_new_diagnoses(
    given: Advice, unexplained: tuple[float, float], failed: float, *, source: str = "the earlier diagnoses"
) -> Advice:
    """Return the advice for a unit whose newest recordings are not explained: inspect now.

    A forecast from older diagnoses does not include the cause that has changed the unit's recordings, so that
    a later replacement, which the forecast advises, may be too late. The reason states this replacement, for
    the case that the inspection finds nothing. Advice to replace now is not changed.

    Parameters
    ----------
    given
        The advice from the older diagnoses.
    unexplained
        Flight hours [h] of the first and of the last recording that are not explained.
    failed
        The probability, according to the forecast, that the unit has already failed.
    source
        Where the forecast comes from, as text.
    """
    if given.replaces_now:
        return given
    first, last = unexplained
    recordings = f"recording, of {last:.9g} h, is"
    if first < last:
        recordings = f"recordings, of {first:.9g} h to {last:.9g} h, are"
    reason = (
        f"the newest {recordings} not explained: the forecast, from {source}, does not include "
        "what has changed; record again, and look for the cause if the new recording is not explained either"
    )
    if given.action == "replace before":
        reason += f"; otherwise replace within {given.hours:,.0f} h, according to {source}"
    return Advice("inspect by", 0.0, failed, reason)


def without_followed_rates(given: Advice, rates: str, failed: float) -> Advice:
    """Return the advice for a unit whose levels change faster than a forecast can follow: inspect now.

    The failure comes earlier than forecast. Advice to replace now is not changed.

    Parameters
    ----------
    given
        The advice according to the forecast.
    rates
        The components that change faster, with their rates per hour, as text.
    failed
        The probability, according to the forecast, that the unit has already failed.
    """
    if given.replaces_now:
        return given
    reason = (
        f"levels change faster than the forecast can follow, per hour: {rates}; check the unit of the hours, "
        "and record again"
    )
    return Advice("inspect by", 0.0, failed, reason)
