"""What to do with a unit, given the distribution of its remaining useful life, and the risk of it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import PrognosisError

WIDE = 3.0
"""Ratio of the RUL's median to the hours that the risk allows, from which an inspection is worth more than a
replacement: most of the life would be thrown away for want of knowledge."""

UNRESOLVED = 3
"""Failures of the sample until the cheapest end, up to which the paths do not resolve it: the probability of
failure until the k-th one is known to 1/sqrt(k), one standard error."""


@dataclass(frozen=True)
class Costs:
    """Of a failure with its consequences, and of a planned replacement; any currency, above 0.

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
                raise PrognosisError(f"the cost of a {name}, {cost:g}, is no cost; give a number above 0")
        if self.failure <= self.replacement:
            raise PrognosisError(
                f"a failure for {self.failure:g} is no dearer than a replacement for {self.replacement:g}: "
                "nothing is gained by replacing before it; give the cost of a failure with its consequences"
            )


@dataclass(frozen=True)
class Advice:
    """One of "fly on", "inspect by", "replace before", in how many hours [h], and the risk until then.

    `risk` is the probability of failure before that, of having failed already where it is now.
    """

    action: str
    hours: float
    risk: float
    reason: str

    def to_dict(self, now: float) -> dict[str, Any]:
        """Return the advice as JSON, `now` being the unit's flight hours [h]."""
        return {
            "action": self.action,
            "in_hours": self.hours,
            "at_hours": now + self.hours,
            "risk": self.risk,
            "reason": self.reason,
        }


def advice_in_words(given: Mapping[str, Any]) -> str:
    """Return what to do and when, of advice as `Advice.to_dict`: hours from now on, and the flight hours."""
    span, until = f"{given['in_hours']:,.0f} h", f"{given['at_hours']:,.0f} h"
    if given["action"] == "fly on":
        return f"fly on for {span} more, until {until}"
    verb, end = given["action"].split()
    return f"{verb} within {span}, {end} {until}" if given["in_hours"] else f"{verb} now"


def advice(
    sample: Array, horizon: float, *, risk: float, age: float = 0.0, costs: Costs | None = None
) -> Advice:
    """Return what to do.

    Without costs, a unit flies as long as its probability of failure is at most `risk`. With costs it flies
    as long as that is cheapest by the hour (age replacement [1]): until the t that minimises

        (c_r (1 - F(t)) + c_f F(t)) / (a + E[min(RUL, t)]).

    At the k-th of n failures, F is a random number, Beta(k, n + 1 - k) whatever the distribution of the RUL
    [2]. With costs its mean k / (n + 1) is taken and stated as the risk: never 0, which the k - 1 failures
    before would make of the first. The reason says where the sample does not resolve the risk or the costs.

    Parameters
    ----------
    sample
        Of the RUL [h], (n,), `inf` for no failure in sight.
    horizon
        How far is planned [h].
    risk
        Largest accepted probability of failure.
    age
        a, hours that the unit has flown for its last replacement [h].

    References
    ----------
    [1] Barlow, Hunter: Optimum preventive maintenance policies, Operations Research 8 (1960).
    [2] David, Nagaraja: Order Statistics, 3rd edition (2003).
    """
    ordered = np.sort(np.asarray(sample, float))
    failed = float(np.mean(ordered == 0))
    if ordered[int(0.5 * (ordered.size - 1))] == 0:
        return Advice("replace before", 0.0, failed, "a requirement is violated already")
    limit, why = _until_risk(ordered, risk) if costs is None else _until_costs(ordered, age, costs)
    if limit >= horizon:
        when = "beyond the horizon" if math.isfinite(limit) else "nowhere in the forecast"
        return Advice("fly on", horizon, float(np.mean(ordered < horizon)), f"{why} {when}")
    before = int(np.sum(ordered < limit))
    until = max(before / ordered.size if costs is None else (before + 1) / (ordered.size + 1), failed)
    if ordered[(ordered.size - 1) // 2] > WIDE * limit:
        return Advice(
            "inspect by",
            limit,
            until,
            f"{why} then, though the unit may well last longer: another diagnosis will tell",
        )
    return Advice("replace before", limit, until, f"{why} then")


def _until_risk(ordered: Array, risk: float) -> tuple[float, str]:
    """Return how long to fly [h] with a risk of at most `risk`, and what happens then."""
    allowed = math.floor(risk * ordered.size + 1e-9)
    why = f"the risk exceeds {100 * risk:g} %"
    if not allowed:
        why = f"the first of {ordered.size} paths, too few for a risk of {100 * risk:g} %, fails"
    return float(ordered[min(allowed, ordered.size - 1)]), why


def _until_costs(ordered: Array, age: float, costs: Costs) -> tuple[float, str]:
    """Return how long it is cheapest to fly [h], and what happens then."""
    why = "a replacement is cheaper"
    finite = ordered[np.isfinite(ordered)]
    if not finite.size:
        return math.inf, why
    # Just before a failure of the sample: between two of them, flying on only adds hours.
    ends = np.unique(finite)
    failed = (np.searchsorted(ordered, ends, "left") + 1) / (ordered.size + 1)
    flown = np.array([np.minimum(ordered, end).mean() for end in ends])
    rates = (costs.replacement * (1 - failed) + costs.failure * failed) / (age + flown + 1e-9)
    best = int(np.argmin(rates))
    never = costs.failure * (finite.size + 1) / (ordered.size + 1) / (age + flown[-1] + 1e-9)
    # From n paths a cost is known to 1/sqrt(n). Where the hazard does not grow, the cheapest hours are those
    # of the last failures of the sample, by less than that.
    if rates[best] >= never * (1 - 1 / math.sqrt(ordered.size)):
        return math.inf, why
    until = int(np.searchsorted(ordered, ends[best], "right"))
    if until <= UNRESOLVED:
        first = "first" if until == 1 else f"first {until}"
        why = f"by the {first} of {ordered.size} paths, too few for so small a risk, {why}"
    return float(ends[best]), why


def without_new_diagnoses(given: Advice, unexplained: tuple[float, float], failed: float) -> Advice:
    """Return the advice where the newest recordings are not explained: to inspect now.

    A forecast from older diagnoses does not know what has changed the unit's recordings meanwhile, so that a
    replacement later on, which they advise, may come too late: the reason says it for the case that nothing
    else is found. One that they advise at once stays.

    Parameters
    ----------
    given
        The advice by the older diagnoses.
    unexplained
        Flight hours [h] of the first and of the last recording that are not explained.
    failed
        The forecast's probability that the unit has failed already.
    """
    if given.action == "replace before" and given.hours == 0:
        return given
    first, last = unexplained
    which = f"recording, of {last:.9g} h, is"
    if first < last:
        which = f"recordings, of {first:.9g} h to {last:.9g} h, are"
    why = (
        f"the newest {which} not explained: the forecast, from the diagnoses before, does not know what has "
        "changed; record again, and look for the cause where that is not explained either"
    )
    if given.action == "replace before":
        why += f"; else replace within {given.hours:,.0f} h, as the diagnoses before advise"
    return Advice("inspect by", 0.0, failed, why)
