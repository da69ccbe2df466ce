"""Cautions of a diagnosis: limits of what the recording identifies, whatever the estimate."""

from collections.abc import Mapping

from emaphm.diagnosis.explanation.load_friction import load_may_be_friction
from emaphm.diagnosis.explanation.load_in_gap import load_reverses_in_gap
from emaphm.diagnosis.explanation.one_value import idle_channels
from emaphm.diagnosis.explanation.open_phases import phases_as_described
from emaphm.diagnosis.explanation.phase_sensors import sensor_may_appear_as_short
from emaphm.diagnosis.explanation.unseen_inertia import unseen_inertia
from emaphm.diagnosis.verdict import Estimate
from emaphm.estimation.rows.means import notes_on_means
from emaphm.estimation.search_result import SearchResult


def cautions(components: Mapping[str, Estimate], result: SearchResult, *, moves: bool) -> tuple[str, ...]:
    """Return notes on rows, channels, inertia, phases and load at `result`, whose faults are `components`.

    If the model does not move (`moves`), channels and inertia are not expected to have information.
    """
    objective, problem = result.objective, result.objective.problem
    return (
        *problem.unknown_start.notes(),
        *notes_on_means(problem),
        *((*idle_channels(problem), *unseen_inertia(objective)) if moves else ()),
        *phases_as_described(components, problem),
        *sensor_may_appear_as_short(components, problem),
        *load_may_be_friction(components, result),
        *load_reverses_in_gap(problem),
    )
