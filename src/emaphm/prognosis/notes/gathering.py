"""All notes of a prognosis, in the order of output."""

from typing import TYPE_CHECKING

from emaphm.arrays import Array
from emaphm.prognosis.notes.failures import failure_notes
from emaphm.prognosis.notes.hours import hours_notes
from emaphm.prognosis.notes.levels import level_notes
from emaphm.prognosis.notes.life import life_notes
from emaphm.prognosis.notes.loads import load_notes
from emaphm.prognosis.notes.newest import newest_notes
from emaphm.prognosis.notes.rates import rate_notes
from emaphm.prognosis.notes.repairs import repair_notes
from emaphm.prognosis.notes.shared_error import shared_error_notes
from emaphm.prognosis.notes.stress import stress_notes

if TYPE_CHECKING:
    from emaphm.prognosis.belief import Belief
    from emaphm.prognosis.evidence import Evidence
    from emaphm.prognosis.prior import Prior
    from emaphm.prognosis.requirements import Requirements
    from emaphm.prognosis.requirements.failure_times import FailureTimes
    from emaphm.prognosis.stress import Stress


def notes_on(
    evidence: "Evidence",
    belief: "Belief",
    level: Array,
    diagnosed_level: Array,
    times: "FailureTimes",
    requirements: "Requirements",
    prior: "Prior",
    *,
    component: str | None,
    ahead: "Stress | None",
) -> tuple[str, ...]:
    """Return the notes of a prognosis.

    `level` and `diagnosed_level` are samples (n, 8) of the levels at present and after the newest used
    diagnosis; `component` is the component that most likely fails first.
    """
    return (
        *evidence.description_notes,
        *repair_notes(evidence),
        *life_notes(evidence, requirements, times, prior),
        *stress_notes(ahead, belief.prior.reference),
        *shared_error_notes(belief, component),
        *level_notes(evidence, level, prior.least_friction),
        *newest_notes(evidence, diagnosed_level),
        *load_notes(evidence),
        *rate_notes(evidence),
        *hours_notes(evidence),
        *(failure_notes(prior.fleet_pace.units, times.limits) if prior.fleet_pace else ()),
    )
