"""A rotor whose electrical zero is not where the position's zero puts it: estimated, and phases left open."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cases import THESIS, on_a_rig
from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.diagnosis.explanation.contradicted_rotor_zero import contradicted_zero
from emaphm.diagnosis.joint.diagnose import diagnose_joint
from emaphm.diagnosis.selection.laws.law_fit import with_open
from emaphm.diagnosis.selection.rotor_zero import is_as_described, with_phases_renamed
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.objective import MapObjective, faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.space.parameter_space import SHORTS
from emaphm.estimation.space.parameter_variation import ParameterVariation
from emaphm.estimation.uncertainty.local_covariance import jacobians_at
from emaphm.recording import Recording
from emaphm.recording.schema import PHASES
from emaphm.report.wording import headline
from emaphm.simulated_recording import simulate
from simulation.rig import altered

pytestmark = pytest.mark.usefixtures("one_search", "unrefined")

TURNED_RAD = 0.12
"""Electrical."""


ZERO_RAD = 0.4
"""Electrical, of another rig."""

FAULTY = Faults(
    friction=0.1, backlash=0.3, short_a=0.1, short_b=0.4, eccentricity=0.2, eccentricity_phase=0.7
)

TURNED = with_lumped_parameters(THESIS, {"rotor_zero": ZERO_RAD})


@cache
def diagnosed(described: Actuator = THESIS) -> Diagnosis:
    """Return the diagnosis of the turned rig, with a healthy phase and two that are shorted."""
    return diagnose(on_a_rig(TURNED, FAULTY, 0.25), described)


def contradicted(recording: Recording, faults: Faults) -> tuple[str, ...]:
    """Return what contradicts the zero at the estimate next to the true `faults`."""
    problem = problem_of(recording, THESIS, channels=("current_A", "voltage_V"))
    objective = faults_objective(problem, ("load",))
    result = correct_bias(objective, objective.space.points(faults.vector[np.newaxis]), 2, seed=0)
    jacobians = jacobians_at(objective, result.point, np.random.default_rng(0))
    return contradicted_zero(result, jacobians, seed=0)


@pytest.mark.parametrize("faults", [Faults(short_b=0.3), Faults(0.3, 0.2, 0.1, 0.4, 0.2, 0.3, 0.6, 0.6)])
def test_a_zero_that_is_off_shows_where_phases_differ(faults: Faults) -> None:
    recording = on_a_rig(THESIS, faults, 0.3)
    assert contradicted(recording, faults) == ()
    electrical = THESIS.electrical
    assert electrical is not None
    # The rotor stands where it stood; the command says that it is elsewhere.
    away = -TURNED_RAD / electrical.pole_pairs * THESIS.mechanics.gear_ratio
    moved = Recording({**recording.channels, "command_rad": recording["command_rad"] + away})
    (reason,) = contradicted(moved, faults)
    found = re.search(r"deviate from the description by (\S+) rad", reason)
    assert found is not None
    assert float(found[1]) == pytest.approx(TURNED_RAD, rel=0.25)


def test_healthy_phases_do_not_show_it() -> None:
    recording = on_a_rig(THESIS, Faults(friction=0.2), 0.3)
    moved = Recording({**recording.channels, "command_rad": recording["command_rad"] + 1e-3})
    assert contradicted(moved, Faults(friction=0.2)) == ()


def test_a_zero_that_nobody_stated_is_estimated_with_the_faults() -> None:
    found = diagnosed()
    assert found.explained
    assert found.selected == ("baseline rotor_zero",)
    zero = found.nuisances["baseline rotor_zero"]
    assert abs(zero.value - ZERO_RAD) < 4 * zero.standard_error < 0.04
    for name in ("friction", "backlash", "eccentricity", "gain"):
        assert found.components[name].value == pytest.approx(getattr(FAULTY, name), abs=0.02)


@pytest.mark.evidence
def test_sensors_that_are_all_late_are_no_other_zero() -> None:
    late = dict.fromkeys(("hall_a", "hall_b", "hall_c"), -TURNED_RAD)
    diagnosis = diagnose(
        on_a_rig(with_lumped_parameters(LAWS["hall-angles"].added_to(THESIS), late), FAULTY, 0.25), THESIS
    )
    assert diagnosis.explained
    assert diagnosis.laws == ("hall-angles",)
    assert diagnosis.selected == ()
    for name, value in late.items():
        estimate = diagnosis.nuisances[f"baseline {name}"]
        assert abs(estimate.value - value) <= 4 * estimate.standard_error
        assert estimate.standard_error < 0.01
    for name in SHORTS:
        assert diagnosis.components[name].value == pytest.approx(getattr(FAULTY, name), abs=0.01)
    advice = "No calibration finds hall-angles; if this persists, give hall_a, hall_b, hall_c in [motor] of"
    assert advice in str(diagnosis)


def test_which_phase_is_which_stays_open_then() -> None:
    found = diagnosed()
    shorts = [found.components[name] for name in SHORTS]
    sizes = sorted(one.value for one in shorts)
    for name, one in zip(SHORTS, shorts, strict=True):
        # Of all zeros a sixth of a turn apart this is the nearest to the described one, so names are right.
        assert one.value == pytest.approx(getattr(FAULTY, name), abs=0.02)
        low, high = one.interval95
        assert low <= getattr(FAULTY, name) <= high
        assert one.verdict == "cannot tell"
        three = ", ".join(f"{size:.3f}" for size in sizes[::-1])
        assert f"the phases have shorts of {three} in unknown order" in one.reason
    assert "Give rotor_zero in [electrical]" in str(found)
    assert found.shorts_of_open_phases == pytest.approx((0.4, 0.1), abs=0.02)
    assert diagnosed(TURNED).shorts_of_open_phases == ()
    assert headline(found).words == (
        "Degraded: friction, backlash, rotor eccentricity, windings (phases open)."
    )
    more, less = (f"{100 * share:.1f} %" for share in found.shorts_of_open_phases)
    said = f"Shorted turns, their phases open: {more} of one winding, {less} of another."
    assert headline(found).sentences[1] == said
    phase = found.components["eccentricity_phase"]
    assert phase.verdict == "cannot tell"
    assert phase.interval95 == (0.0, 1.0)


def test_a_zero_that_is_stated_says_which_phase() -> None:
    found = diagnosed(TURNED)
    assert found.explained
    assert found.selected == ()
    assert [found.components[name].verdict for name in SHORTS] == ["degraded", "degraded", "healthy"]


@pytest.mark.evidence
def test_two_recordings_have_one_zero() -> None:
    heavier = altered(TURNED, mechanics={"offset": 0.05})
    recordings = [on_a_rig(TURNED, FAULTY, 0.2), on_a_rig(heavier, FAULTY, 0.2)]
    found = diagnose_joint(recordings, THESIS)
    assert found.explained
    assert found.selected == ("baseline rotor_zero",)
    assert found.faults.vector == pytest.approx(FAULTY.vector, abs=0.02)
    assert {found.components[name].verdict for name in SHORTS} == {"cannot tell"}


@given(
    faults=st.lists(st.floats(0.01, 0.7), min_size=6, max_size=6),
    direction=st.floats(0.0, 0.99),
    sixths=st.integers(-3, 3),
)
@settings(max_examples=15)
def test_other_names_of_the_phases_are_the_same_motor(
    faults: list[float], direction: float, sixths: int
) -> None:
    objective = turned_objective()
    space = objective.space
    point = space.points(np.array([*faults, direction, 0.4]))
    point[space.coordinates.index("baseline rotor_zero")] = 0.1
    renamed = with_phases_renamed(space, point, THESIS, sixths)
    step = (renamed - point)[space.coordinates.index("baseline rotor_zero")]
    assert step == pytest.approx(-sixths * (np.pi / 3) / 0.25)
    before, after = objective.outputs(np.array([point, renamed]))[:, : objective.channel_rows]
    np.testing.assert_allclose(after, before, atol=1e-6 * np.abs(before).max())


@cache
def turned_objective() -> MapObjective:
    """Return the objective of a recording, with a zero that may be anywhere."""
    objective = faults_objective(problem_of(on_a_rig(THESIS, FAULTY, 0.1), THESIS), ())
    opened = ParameterVariation.free(THESIS, ("rotor_zero",))
    wide = replace(opened, widest=np.array([20.0]))
    return with_open(objective, THESIS, wide)


def test_a_current_that_the_angle_has_made_takes_the_zero_as_described() -> None:
    whole = simulate(THESIS, Chirp(duration=0.1), duration=0.1)
    own = ("time_s", "command_rad", "angle_rad")
    for names, as_described in ((("current_A",), True), ((*PHASES, "current_A"), False)):
        recording = Recording({name: whole[name] for name in (*own, *names)})
        assert is_as_described(faults_objective(problem_of(recording, THESIS), ())) is as_described
