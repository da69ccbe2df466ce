"""A rotor with an undescribed electrical zero: it is estimated, and the names of phases are undecided."""

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
"""Electrical angle [rad]."""


ZERO_RAD = 0.4
"""Electrical angle of another rig [rad]."""

FAULTY = Faults(
    friction=0.1, backlash=0.3, short_a=0.1, short_b=0.4, eccentricity=0.2, eccentricity_phase=0.7
)

TURNED = with_lumped_parameters(THESIS, {"rotor_zero": ZERO_RAD})


@cache
def diagnosed(described: Actuator = THESIS) -> Diagnosis:
    """Return the diagnosis of the turned rig, with one healthy and two shorted phases."""
    return diagnose(on_a_rig(TURNED, FAULTY, 0.25), described)


def contradicted(recording: Recording, faults: Faults) -> tuple[str, ...]:
    """Return the reasons against the described zero at the estimate near the true `faults`."""
    problem = problem_of(recording, THESIS, channels=("current_A", "voltage_V"))
    objective = faults_objective(problem, ("load",))
    result = correct_bias(objective, objective.space.points(faults.vector[np.newaxis]), 2, seed=0)
    jacobians = jacobians_at(objective, result.point, np.random.default_rng(0))
    return contradicted_zero(result, jacobians, seed=0)


@pytest.mark.parametrize("faults", [Faults(short_b=0.3), Faults(0.3, 0.2, 0.1, 0.4, 0.2, 0.3, 0.6, 0.6)])
def test_a_wrong_zero_is_contradicted_where_phases_differ(faults: Faults) -> None:
    recording = on_a_rig(THESIS, faults, 0.3)
    assert contradicted(recording, faults) == ()
    electrical = THESIS.electrical
    assert electrical is not None
    # The rotor is unchanged, and the command is shifted.
    shift = -TURNED_RAD / electrical.pole_pairs * THESIS.mechanics.gear_ratio
    shifted = Recording({**recording.channels, "command_rad": recording["command_rad"] + shift})
    (reason,) = contradicted(shifted, faults)
    match = re.search(r"deviate from the description by (\S+) rad", reason)
    assert match is not None
    assert float(match[1]) == pytest.approx(TURNED_RAD, rel=0.25)


def test_a_wrong_zero_is_not_identifiable_with_healthy_phases() -> None:
    recording = on_a_rig(THESIS, Faults(friction=0.2), 0.3)
    shifted = Recording({**recording.channels, "command_rad": recording["command_rad"] + 1e-3})
    assert contradicted(shifted, Faults(friction=0.2)) == ()


def test_an_undescribed_zero_is_estimated_with_the_faults() -> None:
    diagnosis = diagnosed()
    assert diagnosis.explained
    assert diagnosis.selected == ("baseline rotor_zero",)
    zero = diagnosis.nuisances["baseline rotor_zero"]
    assert abs(zero.value - ZERO_RAD) < 4 * zero.standard_error < 0.04
    for name in ("friction", "backlash", "eccentricity", "gain"):
        assert diagnosis.components[name].value == pytest.approx(getattr(FAULTY, name), abs=0.02)


@pytest.mark.evidence
def test_late_hall_sensors_are_not_read_as_another_zero() -> None:
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


def test_with_an_estimated_zero_the_names_of_the_phases_are_undecided() -> None:
    diagnosis = diagnosed()
    shorts = [diagnosis.components[name] for name in SHORTS]
    sizes = sorted(short.value for short in shorts)
    for name, short in zip(SHORTS, shorts, strict=True):
        # Of the zeros at each sixth of a turn, this is the nearest to the described one: names are right.
        assert short.value == pytest.approx(getattr(FAULTY, name), abs=0.02)
        low, high = short.interval95
        assert low <= getattr(FAULTY, name) <= high
        assert short.verdict == "cannot tell"
        listed_sizes = ", ".join(f"{size:.3f}" for size in sizes[::-1])
        assert f"the phases have shorts of {listed_sizes} in unknown order" in short.reason
    assert "Give rotor_zero in [electrical]" in str(diagnosis)
    assert diagnosis.shorts_of_open_phases == pytest.approx((0.4, 0.1), abs=0.02)
    assert diagnosed(TURNED).shorts_of_open_phases == ()
    assert headline(diagnosis).words == (
        "Degraded: friction, backlash, rotor eccentricity, windings (phases open)."
    )
    larger, smaller = (f"{100 * share:.1f} %" for share in diagnosis.shorts_of_open_phases)
    sentence = f"Shorted turns, their phases open: {larger} of one winding, {smaller} of another."
    assert headline(diagnosis).sentences[1] == sentence
    phase = diagnosis.components["eccentricity_phase"]
    assert phase.verdict == "cannot tell"
    assert phase.interval95 == (0.0, 1.0)


def test_a_stated_zero_identifies_the_phases() -> None:
    diagnosis = diagnosed(TURNED)
    assert diagnosis.explained
    assert diagnosis.selected == ()
    assert [diagnosis.components[name].verdict for name in SHORTS] == ["degraded", "degraded", "healthy"]


@pytest.mark.evidence
def test_recordings_of_one_unit_share_its_zero() -> None:
    heavier = altered(TURNED, mechanics={"offset": 0.05})
    recordings = [on_a_rig(TURNED, FAULTY, 0.2), on_a_rig(heavier, FAULTY, 0.2)]
    diagnosis = diagnose_joint(recordings, THESIS)
    assert diagnosis.explained
    assert diagnosis.selected == ("baseline rotor_zero",)
    assert diagnosis.faults.vector == pytest.approx(FAULTY.vector, abs=0.02)
    assert {diagnosis.components[name].verdict for name in SHORTS} == {"cannot tell"}


@given(
    faults=st.lists(st.floats(0.01, 0.7), min_size=6, max_size=6),
    direction=st.floats(0.0, 0.99),
    sixths=st.integers(-3, 3),
)
@settings(max_examples=15)
def test_renaming_the_phases_does_not_change_the_outputs(
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
    """Return the objective of a recording with a zero that may have any value."""
    objective = faults_objective(problem_of(on_a_rig(THESIS, FAULTY, 0.1), THESIS), ())
    opened = ParameterVariation.free(THESIS, ("rotor_zero",))
    wide = replace(opened, widest=np.array([20.0]))
    return with_open(objective, THESIS, wide)


def test_an_equivalent_current_by_the_angle_requires_the_described_zero() -> None:
    whole = simulate(THESIS, Chirp(duration=0.1), duration=0.1)
    own = ("time_s", "command_rad", "angle_rad")
    for names, as_described in ((("current_A",), True), ((*PHASES, "current_A"), False)):
        recording = Recording({name: whole[name] for name in (*own, *names)})
        assert is_as_described(faults_objective(problem_of(recording, THESIS), ())) is as_described
