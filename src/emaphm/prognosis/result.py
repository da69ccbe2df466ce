"""The prognosis of a unit: what was found, as text and as JSON."""

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from emaphm.actuator import COMPONENTS, NAMES, Actuator
from emaphm.arrays import Array
from emaphm.prognosis.advice import Advice, advice_in_words
from emaphm.prognosis.belief import Belief
from emaphm.prognosis.evidence import Evidence
from emaphm.prognosis.forecast import Paths
from emaphm.prognosis.notes.life import without_rate
from emaphm.prognosis.requirements import Limit, vectors_of
from emaphm.prognosis.requirements.failure_times import FailureTimes
from emaphm.prognosis.settings import LAWS
from emaphm.prognosis.stress import Stress, stress_dict
from emaphm.quantiles import sample_quantile
from emaphm.strict_json import finite
from emaphm.text_table import format_table
from emaphm.version import VERSION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INTERVAL90 = (0.05, 0.95)


class RemainingLife:
    """What a `sample` (n,) of the RUL [h] says; `horizon` [h] as in `probability_of_failure`."""

    horizon: float
    sample: Array

    @property
    def median(self) -> float:
        """Median of the RUL [h], `inf` where no failure is in sight."""
        return sample_quantile(self.sample, 0.5)

    @property
    def interval90(self) -> tuple[float, float]:
        """5 to 95 % of the RUL [h]; `inf` where no failure is in sight."""
        low, high = (sample_quantile(self.sample, p) for p in INTERVAL90)
        return low, high

    @property
    def probability_of_failure(self) -> float:
        """Probability of a failure within the horizon: a requirement or the indicator's limit is reached."""
        return float(np.mean(self.sample <= self.horizon))


@dataclass(frozen=True, eq=False)
class Prognosis(RemainingLife):
    """The remaining useful life (RUL) of a unit.

    Attributes
    ----------
    horizon
        Flight hours from now on for which `probability_of_failure` holds [h].
    values
        The quantity that each limit is on, now, of each path, (limits, n), in the limit's unit.
    times
        When each of n forecast paths fails each limit: `times.hours` (limits, n), flight hours from now
        on [h], `inf` where it does not.
    paths
        The forecast levels [-]: `paths.level` (m, n, 8), at `paths.hours` (m,) from now on [h].
    component, limit
        What most likely fails first, None where no path fails.
    advice
        What to do, in how many flight hours from now on [h], and the risk until then.
    belief, past
        Degradation as it is believed to be now, and as it was at the earlier diagnoses of which that was
        kept: weighted particles of the 8 components, levels [-] and rates [1/h], each at the unit's flight
        `hours` [h].
    seed
        Source of all randomness.
    ahead
        The stress to come, as the question gave it; None where it was left out.
    sample
        The RUL of each path [h], (n,): `inf` where no failure is in sight, 0 where the unit has failed.
    """

    evidence: Evidence
    actuator: Actuator
    horizon: float
    values: Array = field(repr=False)
    times: FailureTimes
    paths: Paths = field(repr=False)
    component: str | None
    limit: Limit | None
    advice: Advice
    belief: Belief = field(repr=False)
    past: tuple[Belief, ...] = field(repr=False)
    seed: int
    ahead: Stress | None = None
    notes: tuple[str, ...] = ()
    sample: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        failed = self.evidence.unrepaired is not None
        sample = np.zeros(self.times.hours.shape[1]) if failed else self.times.first
        object.__setattr__(self, "sample", sample)

    def probabilities(self) -> dict[str, float]:
        """Return by requirement the probability that it fails within the horizon, whatever the others do."""
        return {
            limit.label: float(np.mean(row <= self.horizon))
            for limit, row in zip(self.times.limits, self.times.hours, strict=True)
        }

    def requirements(self) -> dict[str, dict[str, Any]]:
        """Return of each requirement its value now, median and 90 % interval, and when it may fail."""
        probabilities = self.probabilities()
        result: dict[str, dict[str, Any]] = {}
        for limit, row in zip(self.times.limits, self.values, strict=True):
            low, middle, high = (sample_quantile(row, p) for p in (INTERVAL90[0], 0.5, INTERVAL90[1]))
            result[limit.label] = {
                "value": finite(middle),
                "interval90": [finite(low), finite(high)],
                "unit": limit.unit,
                "probability_of_failure": probabilities[limit.label],
            }
        return result

    def levels(self) -> dict[str, dict[str, Any]]:
        """Return of each component its level now, median and 90 % interval, and its laws' probabilities."""
        vectors = vectors_of(self.paths.level[0], self.actuator)
        laws = self.belief.law_probabilities()
        result = {}
        for name in COMPONENTS:
            column = NAMES.index(name)
            low, middle, high = np.quantile(vectors[:, column], (INTERVAL90[0], 0.5, INTERVAL90[1]))
            result[name] = {
                "median": float(middle),
                "interval90": [float(low), float(high)],
                "laws": {law: float(p) for law, p in zip(LAWS, laws[column], strict=True)},
            }
        return result

    def to_dict(self) -> dict[str, Any]:
        """Return the prognosis as JSON; null where no failure is in sight."""
        evidence = self.evidence
        return {
            "unit": evidence.unit,
            "part_number": evidence.part_number,
            "hours": evidence.hours,
            "failed_at_hours": None if evidence.unrepaired is None else evidence.unrepaired.hours,
            "rul_hours": {"median": finite(self.median), "interval90": [finite(x) for x in self.interval90]},
            "horizon_hours": self.horizon,
            "probability_of_failure": self.probability_of_failure,
            "component": self.component,
            "requirement": self.limit.label if self.limit else None,
            "advice": self.advice.to_dict(evidence.hours),
            "requirements": self.requirements(),
            "levels": self.levels(),
            "diagnoses": {
                "used": len(evidence.used),
                "kept": len(evidence.observations),
                "newest_explained": evidence.unexplained is None,
            },
            "stress": stress_dict(self.belief.prior.reference, self.ahead),
            "prior": {"fleet_units": self.belief.prior.units, "fleet_share": self.belief.prior.fleet_share},
            "notes": list(self.notes),
            "seed": self.seed,
            "version": VERSION,
        }

    def __str__(self) -> str:
        evidence = self.evidence
        rows = [
            (
                name,
                f"{level['median']:.3f}",
                "{:.3f} to {:.3f}".format(*level["interval90"]),
                _likeliest(level["laws"]),
            )
            for name, level in self.levels().items()
        ]
        asked = [requirement_row(name, found) for name, found in self.requirements().items()]
        within = f"within {self.horizon:.9g} h"
        cause = f", by {self.component} ({self.limit.label})" if self.limit else ""
        lines = [
            f"{evidence.unit}, part number {evidence.part_number}, at {evidence.hours:.9g} h",
            f"remaining useful life: {self.rul_text()}{cause}",
            f"probability of failure {within}: {100 * self.probability_of_failure:.1f} %",
            f"advice: {advice_text(self.advice, evidence.hours)}",
            "",
            format_table(("component", "level", "90 % interval", "likeliest law"), rows),
            "",
            format_table(("requirement", "now", "90 % interval", f"fails {within}"), asked),
            *([""] if self.notes else []),
            *(f"note: {note}" for note in self.notes),
        ]
        return "\n".join(lines)

    def rul_text(self) -> str:
        """Return the RUL as text, with its 90 % interval."""
        if self.evidence.unrepaired is not None:
            return f"none, failed at {self.evidence.unrepaired.hours:.9g} h"
        low, high = (hours_text(x) for x in self.interval90)
        known = without_rate(len(self.evidence.used))
        return f"{hours_text(self.median)} (90 %: {low} to {high}{known})"

    def plot(self) -> "Figure":
        """Return the figure of health over time and of the RUL; the drawing is `plotting.prognosis`'s."""
        from emaphm.plotting.prognosis import draw_prognosis

        return draw_prognosis(self)


def hours_text(hours: float) -> str:
    """Return hours as text, words for `inf`."""
    return f"{hours:,.0f} h" if math.isfinite(hours) else "no failure in sight"


def requirement_row(name: str, found: dict[str, Any]) -> tuple[str, ...]:
    """Return a requirement as a row of text, as in `Prognosis.requirements`."""
    value, low, high = (
        "not reached" if x is None else f"{x:.4g}" for x in (found["value"], *found["interval90"])
    )
    unit = "" if found["unit"] == "-" else f" {found['unit']}"
    return name, f"{value}{unit}", f"{low} to {high}", f"{100 * found['probability_of_failure']:.1f} %"


def advice_text(given: Advice, now: float) -> str:
    """Return advice as a sentence with its risk, `now` being the unit's flight hours [h]."""
    what = advice_in_words(given.to_dict(now))
    if given.hours == 0:
        return f"{what} ({given.reason})"
    # A risk of one path in many is not none.
    risk = f"{100 * given.risk:{'.1g' if 0 < given.risk < 1e-3 else '.1f'}} %"
    return f"{what}, at a risk of {risk} ({given.reason})"


def _likeliest(laws: dict[str, float]) -> str:
    name = max(laws, key=laws.__getitem__)
    return f"{name} ({100 * laws[name]:.0f} %)"
