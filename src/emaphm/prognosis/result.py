"""Result of a prognosis of a unit, with its text and its JSON."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from emaphm.actuator import COMPONENTS, NAMES, Actuator
from emaphm.arrays import Array
from emaphm.prognosis.advice import Advice
from emaphm.prognosis.belief import Belief
from emaphm.prognosis.evidence import Evidence
from emaphm.prognosis.forecast import Paths
from emaphm.prognosis.notes.life import without_rate
from emaphm.prognosis.requirements import Limit, vectors_of
from emaphm.prognosis.requirements.failure_times import FailureTimes
from emaphm.prognosis.settings import LAWS
from emaphm.prognosis.stress import Stress, stress_dict
from emaphm.prognosis.wording.sentences import advice_text, hours_text
from emaphm.prognosis.wording.tables import level_table, requirement_table
from emaphm.quantiles import sample_quantile
from emaphm.strict_json import finite
from emaphm.text_table import format_table
from emaphm.version import VERSION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INTERVAL90 = (0.05, 0.95)


class RemainingLife:
    """Statistics of a `sample` (n,) of the RUL [h]; `horizon` [h] is used by `probability_of_failure`."""

    horizon: float
    sample: Array

    @property
    def median(self) -> float:
        """Median of the RUL [h], `inf` if no failure is in sight."""
        return sample_quantile(self.sample, 0.5)

    @property
    def interval90(self) -> tuple[float, float]:
        """5 % and 95 % quantiles of the RUL [h]; `inf` if no failure is in sight."""
        low, high = (sample_quantile(self.sample, p) for p in INTERVAL90)
        return low, high

    @property
    def probability_of_failure(self) -> float:
        """Probability that a requirement fails, or the indicator reaches its limit, within the horizon."""
        return float(np.mean(self.sample <= self.horizon))


@dataclass(frozen=True, eq=False)
class Prognosis(RemainingLife):
    """The remaining useful life (RUL) of a unit.

    Attributes
    ----------
    horizon
        Flight hours from now on for which `probability_of_failure` holds [h].
    values
        Present value of the limited quantity, for each limit and path, (limits, n), in the limit's unit.
    times
        Failure times of n forecast paths for each limit: `times.hours` (limits, n), flight hours from now
        on [h], `inf` without a failure.
    paths
        The forecast levels [-]: `paths.level` (m, n, 8), at `paths.hours` (m,) from now on [h].
    component, limit
        Component and limit that most likely fail first, None if no path fails; for a failed unit, those that
        a shop found.
    advice
        Action, its flight hours from now on [h], and the risk until then.
    belief, past
        Filter states: the present one, and those kept at earlier diagnoses. Each has weighted particles of
        the 8 components, with levels [-] and rates [1/h], at the unit's flight `hours` [h].
    seed
        Seed of the random streams.
    ahead
        The future stress as given in the question; None if it was left out.
    sample
        The RUL of each path [h], (n,): `inf` without a failure in sight, 0 if the unit has failed.
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
        """Return for each requirement the probability that it fails within the horizon, by itself."""
        return {
            limit.label: float(np.mean(row <= self.horizon))
            for limit, row in zip(self.times.limits, self.times.hours, strict=True)
        }

    def requirements(self) -> dict[str, dict[str, Any]]:
        """Return for each requirement its present value, 90 % interval and probability of failure."""
        probabilities = self.probabilities()
        result: dict[str, dict[str, Any]] = {}
        for limit, row in zip(self.times.limits, self.values, strict=True):
            low, median, high = (sample_quantile(row, p) for p in (INTERVAL90[0], 0.5, INTERVAL90[1]))
            result[limit.label] = {
                "value": finite(median),
                "interval90": [finite(low), finite(high)],
                "unit": limit.unit,
                "probability_of_failure": probabilities[limit.label],
            }
        return result

    def levels(self) -> dict[str, dict[str, Any]]:
        """Return for each component the median and 90 % interval of its level, and law probabilities."""
        vectors = vectors_of(self.paths.level[0], self.actuator)
        laws = self.belief.law_probabilities()
        result = {}
        for name in COMPONENTS:
            column = NAMES.index(name)
            low, median, high = (
                sample_quantile(vectors[:, column], p) for p in (INTERVAL90[0], 0.5, INTERVAL90[1])
            )
            result[name] = {
                "median": median,
                "interval90": [low, high],
                "laws": {law: float(p) for law, p in zip(LAWS, laws[column], strict=True)},
            }
        return result

    def to_dict(self) -> dict[str, Any]:
        """Return the prognosis as JSON; a RUL without a failure in sight is null."""
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
                "flights": evidence.flights,
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
        tables = level_table(self.levels()), requirement_table(self.requirements(), self.horizon)
        within = f"within {self.horizon:.9g} h"
        cause = f", by {self.cause}" if self.cause else ""
        lines = [
            f"{evidence.unit}, part number {evidence.part_number}, at {evidence.hours:.9g} h",
            f"remaining useful life: {self.rul_text()}{cause}",
            f"probability of failure {within}: {100 * self.probability_of_failure:.1f} %",
            f"advice: {advice_text(self.advice, evidence.hours)}",
            "",
            format_table(tables[0].header, tables[0].rows),
            "",
            format_table(tables[1].header, tables[1].rows),
            *([""] if self.notes else []),
            *(f"note: {note}" for note in self.notes),
        ]
        return "\n".join(lines)

    def rul_text(self) -> str:
        """Return the RUL as text, with its 90 % interval."""
        if self.evidence.unrepaired is not None:
            cause_text = "" if self.cause else ", cause not found"
            return f"none, failed at {self.evidence.unrepaired.hours:,.9g} h{cause_text}"
        low, high = (hours_text(x) for x in self.interval90)
        evidence_text = without_rate(self.evidence.flights)
        return f"{hours_text(self.median)} (90 %: {low} to {high}{evidence_text})"

    @property
    def cause(self) -> str:
        """Component and requirement that fail first, or that a shop found failed, as text; may be empty."""
        label = self.limit.label if self.limit else ""
        return f"{self.component} ({label})" if self.component and label else self.component or label

    def plot(self) -> "Figure":
        """Return the figure of the levels and of the RUL over time (`plotting.prognosis`)."""
        from emaphm.plotting.prognosis import draw_prognosis

        return draw_prognosis(self)
