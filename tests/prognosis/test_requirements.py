"""Requirements and their measures against closed forms of the drive; invalid requirements."""

import math
import tomllib

import numpy as np
import pytest

from emaphm.actuator import Actuator, Faults, Step
from emaphm.actuator.faults import to_cartesian
from emaphm.actuator.requirements import Requirement
from emaphm.actuator.toml import write_toml
from emaphm.errors import ActuatorError
from emaphm.prognosis import Requirements, failure_levels
from emaphm.prognosis.forecast import Paths
from emaphm.prognosis.requirements import vectors_of
from emaphm.prognosis.requirements.capability import measured
from emaphm.prognosis.requirements.measure_passage import measure_passage
from emaphm.simulated_recording import simulate

THESIS = Actuator.thesis()
HEALTHY = Faults().vector


def described(*requirements: dict[str, object]) -> Actuator:
    values = THESIS.model_dump(exclude_none=True) | {"requirements": list(requirements)}
    return Actuator.from_dict(values)


def measure(name: str, *faults: Faults, **settings: object) -> list[float]:
    requirement = Requirement.model_validate({"measure": name, "at_most": 0.5, **settings})
    vectors = np.stack([fault.vector for fault in faults])
    return [float(x) for x in measured(THESIS, requirement, vectors)]


def test_free_play_equals_the_backlash_referred_to_the_user() -> None:
    healthy, worn = measure("free_play", Faults(), Faults(backlash=0.5))
    assert healthy == pytest.approx(5e-3 / 500)
    assert worn == pytest.approx(5e-3 * (1 + 9 * 0.5) / 500)


def test_the_stall_margin_equals_the_stall_torque() -> None:
    """The shaft creeps under the rising load, so it holds the largest motor torque plus dynamic friction."""
    (margin,) = measure("stall_margin", Faults(), load=0.5, duration=4.0)
    assert margin == pytest.approx((1.689 + 0.05 * 1.689) / 0.5, rel=0.02)
    (worn,) = measure("stall_margin", Faults(friction=0.5), load=0.5, duration=4.0)
    assert worn == pytest.approx((1.689 + 0.1 * 1.689) / 0.5, rel=0.02)


@pytest.mark.parametrize(
    ("name", "fault"), [("thesis", Faults(short_b=0.5)), ("six_step", Faults()), ("pmsm", Faults())]
)
def test_a_shaft_that_slips_and_stops_within_the_amplitude_counts_as_held(name: str, fault: Faults) -> None:
    """The torque is that of the phases that conduct after the slip, without back-EMF of a runaway motor."""
    actuator: Actuator = getattr(Actuator, name)()
    requirement = Requirement(measure="stall_margin", at_least=1.0, load=0.5)
    (margin,) = measured(actuator, requirement, fault.vector[np.newaxis])
    assert 0.97 < margin / ((1.689 + 0.05 * 1.689) / 0.5) < 1.06


def test_a_settling_time_has_no_floating_point_rounding_error() -> None:
    for level in np.linspace(0, 0.5, 11):
        (settling_time,) = measure("settling_time", Faults(gain=float(level)))
        assert settling_time == float(f"{settling_time:.4f}")


def test_the_peak_current_of_a_step_between_samples_is_found() -> None:
    """The peak, which lasts below 1 ms, follows from the first error, torque constant and speed gain."""
    (coarse,) = measure("peak_current", Faults(), command="step", amplitude=3e-4)
    fine = simulate(THESIS, Step(3e-4), model="averaged", duration=0.05, sample_rate=20_000.0)
    assert coarse == pytest.approx(np.abs(fine["current_A"]).max(), rel=0.03)


def test_the_stall_margin_of_a_soft_position_loop_follows_from_its_gain_and_the_amplitude() -> None:
    """The torque is GAP (0.05 N·m·s/rad) times G times the position error; friction holds in addition."""
    healthy, soft = measure("stall_margin", Faults(), Faults(gain=0.0), load=0.5, amplitude=2e-4)
    for margin, gain in ((healthy, 1e5), (soft, 0.5e5)):
        assert margin == pytest.approx((0.05 * gain * (2e-4 + 5e-6) + 0.05 * 1.689) / 0.5, rel=0.05)


@pytest.mark.parametrize("duration", [0.5, 4.0])
def test_the_stall_margin_does_not_depend_on_the_rate_of_the_load(duration: float) -> None:
    (worn,) = measure("stall_margin", Faults(friction=0.5), load=0.5, duration=duration)
    assert worn == pytest.approx((1.689 + 0.1 * 1.689) / 0.5, rel=0.02)


def test_the_tracking_error_of_a_motion_that_is_too_fast_is_the_whole_command() -> None:
    """There are more than two samples per period; two could coincide with the zeros of the sine."""
    sine = {"command": "sine", "amplitude": 1e-4, "frequency_hz": 1000.0}
    assert measure("tracking_error", Faults(), **sine) == pytest.approx([1e-4 / math.sqrt(2)], rel=0.01)


def test_the_tracking_error_of_a_slow_sine_is_its_speed_over_the_gain() -> None:
    """For a slow sine of amplitude A and frequency f with P control, the rms error is 2π f A / (G √2)."""
    (error,) = measure(
        "tracking_error", Faults(), command="sine", frequency_hz=0.5, amplitude=0.02, duration=2.0
    )
    # G_prop converts the user's position error to the motor's speed: 1e5 (1/s) × 1/500.
    lag = 2 * math.pi * 0.5 * 0.02 / (1e5 / 500) / math.sqrt(2)
    assert error == pytest.approx(lag, rel=0.15)
    (slow,) = measure(
        "tracking_error", Faults(gain=0.0), command="sine", frequency_hz=0.5, amplitude=0.02, duration=2.0
    )
    assert slow == pytest.approx(2 * lag, rel=0.15)


def test_the_bandwidth_of_a_small_motion_agrees_with_the_linear_position_loop() -> None:
    """Far from all limits the loop is of second order: 1/(1 + s/K + s² J/(K D)), K = G τ, D = GAP."""
    gain, damping, inertia = 1e5 / 500 / 2, 5e-2 * 1.0, 2.5e-5
    frequencies = np.linspace(1, 100, 10_000)
    s = 2j * np.pi * frequencies
    response = np.abs(1 / (1 + s / gain + s**2 * inertia / (gain * damping)))
    exact = frequencies[np.argmax(response < 1 / np.sqrt(2))]
    smooth = THESIS.mechanics.model_copy(
        update={
            "static_friction_motor": 0.0,
            "static_friction_user": 0.0,
            "dynamic_friction_motor": 0.0,
            "dynamic_friction_user": 0.0,
            "backlash": 0.0,
        }
    )
    actuator = THESIS.model_copy(update={"mechanics": smooth})
    requirement = Requirement(measure="bandwidth", at_least=5.0, amplitude=1e-3)
    (bandwidth,) = measured(actuator, requirement, Faults(gain=0.0).vector[np.newaxis])
    assert bandwidth == pytest.approx(exact, rel=0.03)


def test_a_step_settles_later_with_half_the_gain_and_never_against_an_excessive_load() -> None:
    healthy, slow = measure("settling_time", Faults(), Faults(gain=0.0))
    # The position loop settles to 5 % in three time constants, after the acceleration.
    assert slow == pytest.approx(3 / (1e5 / 500 / 2), rel=0.5)
    assert healthy < slow
    assert measure("settling_time", Faults(), load=5.0) == [math.inf]


def test_peak_current_grows_with_friction() -> None:
    healthy, worn = measure("peak_current", Faults(), Faults(friction=1.0))
    assert 0 < healthy < worn <= 22.5 * 1.1


@pytest.mark.parametrize(
    "settings",
    [
        {"measure": "tracking_error", "at_most": 1.0},
        {"measure": "peak_current", "at_most": 50.0, "command": "step"},
        {"measure": "settling_time", "at_most": 0.4},
        {"measure": "bandwidth", "at_least": 3.0},
        {"measure": "stall_margin", "at_least": 0.1, "load": 0.05},
    ],
    ids=lambda settings: str(settings["measure"]),
)
def test_measures_of_an_actuator_at_an_end_stop_are_taken_in_the_middle_of_its_travel(
    settings: dict[str, object],
) -> None:
    stops = THESIS.mechanics.model_copy(update={"end_stops": (-1e-3, 0.5)})
    from_0 = described(settings)
    retracted = from_0.model_copy(update={"mechanics": stops})
    vectors = np.array([Faults().vector, Faults(friction=0.4, gain=0.7).vector])
    actual, expected = (
        measured(actuator, actuator.requirements[0], vectors) for actuator in (retracted, from_0)
    )
    # Half a radian further, only the rounding of the angle of 25 motor turns differs.
    np.testing.assert_allclose(actual, expected, rtol=1e-3)


def test_a_measure_at_the_end_of_its_search_range_holds_a_limit_at_that_end() -> None:
    actuator = described(
        {"measure": "bandwidth", "at_least": 5.0, "frequency_hz": 5.0, "amplitude": 1e-3},
        {"measure": "stall_margin", "at_least": 4.0, "load": 0.1},
    )
    assert np.all(Requirements(actuator).margins(HEALTHY[np.newaxis]) == 0)


def test_failure_levels_of_components_and_of_free_play_agree_with_closed_forms() -> None:
    actuator = described(
        {"component": "backlash", "at_most": 0.6},
        {"component": "gain", "at_least": 0.3, "at_most": 0.7},
        {"measure": "free_play", "at_most": 5e-5},
    )
    backlash, above, below, play = failure_levels(actuator)
    assert backlash.levels["backlash"] == pytest.approx((0.6, None))
    assert backlash.levels["friction"] == (None, None)
    assert above.levels["gain"] == pytest.approx((0.7, None))
    assert below.levels["gain"][1] == pytest.approx(0.3)
    assert play.levels["backlash"][0] == pytest.approx((5e-5 * 500 / 5e-3 - 1) / 9)
    assert [one.can_fail for one in (backlash, above, below, play)] == [True] * 4
    assert [one.limit.label for one in (above, below)] == ["gain at most 0.7", "gain at least 0.3"]


def test_the_failure_level_of_a_discontinuous_measure_is_at_its_jump() -> None:
    """Above some friction a step never settles; its level is found more finely than the grid of 41 levels."""
    actuator = described({"measure": "settling_time", "at_most": 0.1, "amplitude": 5e-4})
    (found,) = failure_levels(actuator)
    level = found.levels["friction"][0]
    assert level is not None
    near = np.stack([Faults(friction=friction).vector for friction in (level - 2e-3, level)])
    holds, fails = Requirements(actuator).margins(near)[0]
    assert fails < 0 < holds


def test_a_least_settling_time_fails_where_an_endless_step_begins_to_settle() -> None:
    """A step of 1 mrad of the built-in PMSM drive settles within 20 ms from a gain of 0.508 on, or never."""
    least = Requirement(measure="settling_time", at_least=0.02, duration=0.2, amplitude=1e-3)
    pmsm = Actuator.load("pmsm").model_copy(update={"requirements": (least,)})
    (result,) = failure_levels(pmsm)
    rising, _ = result.levels["gain"]
    assert math.isinf(result.value)
    assert rising is not None
    settles = [measured(pmsm, least, Faults(gain=rising + step).vector[np.newaxis]) for step in (-1e-3, 1e-3)]
    assert settles[0] == math.inf
    assert settles[1] < 0.02
    # Along paths of a rising gain, the failure is at the first time at which the step settles.
    hours = np.array([0.0, 10.0, 20.0, 30.0])
    level = np.tile(to_cartesian(Faults().vector), (4, 2, 1))
    level[:, :, 7] = np.array([[0.4, 0.45, 0.49, 0.6], [0.4, 0.6, 0.6, 0.6]]).T
    requirements = Requirements(pmsm)
    now, last = (requirements.margins(vectors_of(one, pmsm))[0] for one in (level[0], level[-1]))
    paths = Paths(hours, level, np.zeros((3, 2, 8)))
    passage = measure_passage(paths, requirements, requirements.limits[0], now, last)
    assert passage.tolist() == [30.0, 10.0]


@pytest.mark.parametrize(("name", "absent"), [("thesis", 0), ("dc", 4)])
def test_a_fault_that_the_actuator_cannot_have_has_no_failure_level(name: str, absent: int) -> None:
    actuator: Actuator = getattr(Actuator, name)()
    assert len(failure_levels(actuator)) == 6 - absent
    short = {"component": "short_a", "at_most": 0.4}
    values = actuator.model_dump(exclude_none=True) | {"requirements": [short]}
    (found,) = failure_levels(Actuator.from_dict(values))
    assert len(found.levels) == 7 - absent
    assert found.can_fail == (absent == 0)


def test_requirements_with_equal_names_are_numbered() -> None:
    limits = [{"component": "backlash", "name": "play", "at_most": limit} for limit in (0.6, 0.65, 0.6)]
    labels = [limit.label for limit in Requirements(described(*limits)).limits]
    assert labels == ["play at most 0.6", "play at most 0.65", "play at most 0.6 (2)"]


def test_given_faults_can_violate_a_requirement() -> None:
    actuator = described({"measure": "free_play", "at_most": 5e-5, "name": "play"})
    (found,) = failure_levels(actuator, Faults(backlash=0.6))
    assert found.violated
    assert found.limit.label == "play at most 5e-05 rad"


def test_a_requirement_at_the_healthy_value_is_violated_by_the_smallest_fault() -> None:
    backlash, gain, friction, short = failure_levels(
        described(
            {"component": "backlash", "at_most": 0.0},
            {"component": "gain", "at_least": 0.5},
            {"component": "friction", "at_least": 0.0},
            {"component": "short_a", "at_least": 0.0},
        )
    )
    assert backlash.levels["backlash"] == pytest.approx((0.0, None))
    assert gain.levels["gain"][0] is None
    assert gain.levels["gain"][1] == pytest.approx(0.5)
    # A friction may fall below that of a new unit; a short cannot.
    assert friction.levels["friction"] == pytest.approx((None, 0.0))
    assert not any(one.violated for one in (backlash, gain, friction, short))
    assert [one.can_fail for one in (backlash, gain, friction, short)] == [True, True, True, False]


def test_a_requirement_that_no_fault_can_violate_is_marked() -> None:
    (found,) = failure_levels(described({"measure": "free_play", "at_most": 1.0}))
    assert not found.can_fail
    assert not found.violated


def test_a_measure_equal_to_its_limit_satisfies_it() -> None:
    """A settling time is a number of samples: one that ends exactly at its limit violates nothing."""
    worst = measure("settling_time", *(Faults(friction=level) for level in np.linspace(0, 1, 41)))
    actuator = described({"measure": "settling_time", "at_most": max(worst)})
    (found,) = failure_levels(actuator)
    assert found.levels["friction"] == (None, None)
    assert np.all(Requirements(actuator).margins(np.stack([Faults(friction=1.0).vector])) == 0)


def test_an_actuator_without_requirements_fails_at_the_end_of_its_scales() -> None:
    requirements = Requirements(THESIS)
    assert not requirements.stated
    assert all(limit.bound == 1 for limit in requirements.limits)


def test_margins_are_in_the_units_of_the_limits() -> None:
    requirements = Requirements(
        described({"component": "friction", "at_most": 0.4}, {"measure": "free_play", "at_most": 5e-5})
    )
    margins = requirements.margins(np.stack([HEALTHY, Faults(friction=0.5).vector]))
    assert margins == pytest.approx(np.array([[0.4, -0.1], [4e-5, 4e-5]]))


def test_requirements_are_kept_in_the_file() -> None:
    actuator = described(
        {"component": "backlash", "at_most": 0.6}, {"measure": "bandwidth", "at_least": 20.0}
    )
    assert Actuator.from_dict(tomllib.loads(write_toml(actuator))) == actuator
    assert "requirements" not in write_toml(THESIS)


WRONG: dict[str, dict[str, object]] = {
    "not both": {"component": "friction", "measure": "bandwidth", "at_most": 0.5},
    "give component or measure": {"at_most": 0.5},
    "needs a limit": {"component": "friction"},
    "must be below": {"component": "gain", "at_most": 0.3, "at_least": 0.7},
    "a level lies in [0, 1]": {"component": "backlash", "at_most": 60.0},
    "a level lies in [-1, 1]": {"component": "friction", "at_most": 60.0},
    "give load": {"measure": "stall_margin", "at_least": 1.5},
    "from 2 to 100 Hz": {"measure": "bandwidth", "at_least": 120.0},
    "from 2 to 10 Hz": {"measure": "bandwidth", "at_least": 15.0, "frequency_hz": 10.0},
    "give limits above 2": {"measure": "bandwidth", "at_least": 1.0},
    "give limits above 2, and a frequency_hz above them": {
        "measure": "bandwidth",
        "at_least": 1.5,
        "frequency_hz": 1.0,
    },
    "4 at most, of a larger load": {"measure": "stall_margin", "at_least": 5.0, "load": 0.05},
    "give a longer duration": {"measure": "settling_time", "at_most": 0.8},
    "no peak_current is below 0": {"measure": "peak_current", "at_most": -5.0},
    "give a shorter duration": {
        "measure": "peak_current",
        "at_most": 5.0,
        "command": "sine",
        "frequency_hz": 1000.0,
        "duration": 4.0,
    },
    "is beyond the end stops": {"measure": "tracking_error", "at_most": 1.0, "amplitude": 5.0},
    "did you mean 'at_most'": {"component": "friction", "atmost": 0.6},
    "'friction', 'backlash'": {"component": "frictoin", "at_most": 0.6},
}


@pytest.mark.parametrize("message", WRONG)
def test_errors_in_requirements_are_refused_with_a_message_that_names_them(message: str) -> None:
    with pytest.raises(ActuatorError) as error:
        described(WRONG[message])
    assert message in str(error.value)
    assert "requirements" in str(error.value)
    assert "\n" not in str(error.value)
