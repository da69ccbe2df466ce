"""Alternative explanations of a recording, and their effect on intervals and verdicts."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cases import THESIS
from emaphm.actuator import Faults
from emaphm.actuator.faults import HEALTHY
from emaphm.diagnosis.explanation.other_values import OTHER_DIRECTION, with_other_value
from emaphm.diagnosis.verdict import estimates, verdict_of, with_phase_undecided
from emaphm.estimation.space.parameter_space import ParameterSpace

SPACE = ParameterSpace.of(THESIS)
ECCENTRIC = ("eccentricity", "eccentricity_phase")
WHY = "where all comes late"
DEVIATIONS = st.lists(st.floats(0.0, 0.2), min_size=8, max_size=8)
"""Deviations from healthy, in the range where verdicts change."""


@given(deviations=DEVIATIONS, others=DEVIATIONS, error=st.floats(1e-3, 0.05))
def test_a_verdict_follows_from_the_interval_that_includes_the_alternatives(
    deviations: list[float], others: list[float], error: float
) -> None:
    point = SPACE.points((HEALTHY.vector + deviations)[np.newaxis])[0]
    before = estimates(SPACE, point, np.diag(np.full(8, error**2)))
    for (name, estimate), other in zip(before.items(), HEALTHY.vector + others, strict=True):
        widened = with_other_value(name, estimate, estimate, float(other), WHY)
        low, high = widened.interval95
        assert low <= estimate.interval95[0]
        assert high >= estimate.interval95[1]
        if name == "eccentricity_phase":
            half_width = (estimate.interval95[1] - estimate.interval95[0]) / 2
            stays = abs(other - estimate.value) <= max(half_width, OTHER_DIRECTION)
        else:
            stays = verdict_of(widened.interval95, getattr(HEALTHY, name)) == estimate.verdict
        assert widened.verdict == (estimate.verdict if stays else "cannot tell")
        assert bool(widened.reason) == (widened.verdict == "cannot tell")


def test_an_unconstrained_direction_is_unchanged_by_an_alternative() -> None:
    healthy = estimates(SPACE, SPACE.points(HEALTHY.vector), np.diag(np.full(8, 0.01**2)))
    phase = healthy["eccentricity_phase"]
    assert phase.unconstrained
    assert with_other_value("eccentricity_phase", phase, phase, 0.9, WHY) == phase


def test_the_verdict_of_the_phase_is_open_where_that_of_the_eccentricity_is() -> None:
    point = SPACE.points(Faults(eccentricity=0.06, eccentricity_phase=0.3).vector[np.newaxis])[0]
    before = estimates(SPACE, point, np.diag(np.full(8, 0.015**2)))
    assert [before[name].verdict for name in ECCENTRIC] == ["degraded"] * 2
    others = {name: 0.04 if name == "eccentricity" else estimate.value for name, estimate in before.items()}
    after = {
        name: with_other_value(name, estimate, estimate, others[name], WHY)
        for name, estimate in before.items()
    }
    assert [with_phase_undecided(after, before)[name].verdict for name in ECCENTRIC] == ["cannot tell"] * 2
