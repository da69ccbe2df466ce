"""Other explanations of a recording, and what they leave of a verdict."""

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
AWAY = st.lists(st.floats(0.0, 0.2), min_size=8, max_size=8)
"""From healthy, where verdicts change."""


@given(away=AWAY, others=AWAY, error=st.floats(1e-3, 0.05))
def test_a_verdict_is_what_the_interval_with_the_alternatives_says(
    away: list[float], others: list[float], error: float
) -> None:
    point = SPACE.points((HEALTHY.vector + away)[np.newaxis])[0]
    before = estimates(SPACE, point, np.diag(np.full(8, error**2)))
    for (name, one), other in zip(before.items(), HEALTHY.vector + others, strict=True):
        found = with_other_value(name, one, one, float(other), WHY)
        low, high = found.interval95
        assert low <= one.interval95[0]
        assert high >= one.interval95[1]
        if name == "eccentricity_phase":
            half_width = (one.interval95[1] - one.interval95[0]) / 2
            stays = abs(other - one.value) <= max(half_width, OTHER_DIRECTION)
        else:
            stays = verdict_of(found.interval95, getattr(HEALTHY, name)) == one.verdict
        assert found.verdict == (one.verdict if stays else "cannot tell")
        assert bool(found.reason) == (found.verdict == "cannot tell")


def test_a_direction_that_is_open_stays_open() -> None:
    healthy = estimates(SPACE, SPACE.points(HEALTHY.vector), np.diag(np.full(8, 0.01**2)))
    phase = healthy["eccentricity_phase"]
    assert phase.unconstrained
    assert with_other_value("eccentricity_phase", phase, phase, 0.9, WHY) == phase


def test_the_phase_is_undecided_with_the_eccentricity() -> None:
    point = SPACE.points(Faults(eccentricity=0.06, eccentricity_phase=0.3).vector[np.newaxis])[0]
    before = estimates(SPACE, point, np.diag(np.full(8, 0.015**2)))
    assert [before[name].verdict for name in ECCENTRIC] == ["degraded"] * 2
    others = {name: 0.04 if name == "eccentricity" else one.value for name, one in before.items()}
    after = {name: with_other_value(name, one, one, others[name], WHY) for name, one in before.items()}
    assert [with_phase_undecided(after, before)[name].verdict for name in ECCENTRIC] == ["cannot tell"] * 2
