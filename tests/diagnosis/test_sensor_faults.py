"""Sensor faults are identified and sized, without bias of the actuator's faults."""

import json
from collections.abc import Callable

import numpy as np
import pytest

from cases import THESIS, drawn
from emaphm.actuator import Chirp, Faults, Sine
from emaphm.arrays import Array
from emaphm.diagnosis import Diagnosis, diagnose, error_percent
from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate
from emaphm.diagnosis.sensor_faults import sensor_faults
from emaphm.estimation.global_search import restarts
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

pytestmark = pytest.mark.usefixtures("one_search")

TRUTH = Faults.from_vector(drawn(1, seed=5)[0])
LINE = ("current_A", "voltage_V")
FOUR = (*LINE, "position_rad", "speed_rad_s")

WORST = 2.5
"""Largest error [%] of a recording of the base setting: 11 of 12 rows of the docs have less at 95 %."""


def test_a_selected_error_of_an_unrecorded_channel_is_no_sensor_fault() -> None:
    assert sensor_faults((), ("position_scale",), {}, (), ("current_A",), THESIS, explained=True) == ()


def test_a_wrong_scale_of_speed_may_be_that_of_the_position_sensor() -> None:
    estimate = {"speed_scale": NuisanceEstimate(0.03, 1e-4, "-", True)}
    for channels, also in ((FOUR, True), ((*LINE, "speed_rad_s"), False)):
        (fault,) = sensor_faults((), tuple(estimate), estimate, (), channels, THESIS, explained=True)
        assert "The sensor of speed_rad_s shows 1.03 times its quantity" in fault.sentence
        assert ("A wrong scale of the position sensor" in fault.sentence) == also


@pytest.mark.parametrize(("factor", "unit"), [(9.55, "rpm"), (57.2, "deg/s"), (0.16, "turns/s"), (9.0, None)])
def test_a_speed_with_the_factor_of_another_unit_has_its_name(factor: float, unit: str | None) -> None:
    estimate = {"speed_scale": NuisanceEstimate(factor - 1, 1e-3, "-", True)}
    (fault,) = sensor_faults((), tuple(estimate), estimate, (), FOUR, THESIS, explained=True)
    assert ("under [channels]" in fault.sentence) == (unit is not None)
    if unit is not None:
        assert f"A speed in {unit} has this factor" in fault.sentence


@pytest.fixture
def unrefined(monkeypatch: pytest.MonkeyPatch) -> None:
    """Omit the refinement of unexplained searches, to save time: the steps after it are tested here.

    Refinement is tested in `tests/estimation/test_reference_refinement.py`.
    """
    monkeypatch.setattr(restarts, "refine_by_reference", lambda result, _: result)


def recorded(duration: float) -> Recording:
    command = Chirp(duration=duration)
    return simulate(THESIS, command, faults=TRUTH, duration=duration, noise=0.05, adc_bits=12)


@pytest.fixture(scope="module")
def unspoilt() -> Recording:
    return recorded(0.2)


def diagnosed(
    unspoilt: Recording, channels: tuple[str, ...], spoil: Callable[[str, Array], Array] | None = None
) -> Diagnosis:
    columns = {name: np.array(unspoilt[name]) for name in ("time_s", "command_rad")}
    for name in channels:
        columns[name] = np.array(unspoilt[name]) if spoil is None else spoil(name, np.array(unspoilt[name]))
    return diagnose(Recording(columns), THESIS)


def check(diagnosis: Diagnosis, channel: str, kind: str, size: float, error: float) -> None:
    assert diagnosis.explained
    (fault,) = diagnosis.sensor_faults
    assert (fault.channel, fault.kind) == (channel, kind)
    assert fault.size == pytest.approx(size, abs=error)
    assert [line for line in diagnosis.notes() if fault.sentence in line] == [
        f"Sensor fault: {fault.sentence}"
    ]
    assert json.loads(diagnosis.to_json())["sensor_faults"][0]["kind"] == kind
    assert error_percent(TRUTH.vector, diagnosis.faults.vector) <= WORST


def test_healthy_sensors_have_no_fault(unspoilt: Recording) -> None:
    # For current and voltage alone, see test_nuisance_selection.
    diagnosis = diagnosed(unspoilt, FOUR)
    assert diagnosis.explained
    assert diagnosis.sensor_faults == ()


@pytest.fixture(
    scope="module",
    params=[0.0, pytest.param(0.3, marks=pytest.mark.evidence)],
    ids=["healthy", "eccentric"],
)
def coarse(request: pytest.FixtureRequest) -> Recording:
    """Return a recording whose position covers about ten counts of its converter."""
    faults = Faults(eccentricity=request.param)
    return simulate(
        THESIS,
        Sine(5e-3, 9.0),
        faults=faults,
        duration=0.3,
        sample_rate=2000.0,
        noise=0.02,
        adc_bits=10,
        seed=1,
    )


def test_counts_of_a_converter_are_no_sensor_fault(coarse: Recording) -> None:
    diagnosis = diagnosed(coarse, (*LINE, "position_rad"))
    assert diagnosis.explained
    assert diagnosis.selected == ()


@pytest.mark.evidence
@pytest.mark.parametrize("coarse", [0.3], indirect=True, ids=["eccentric"])
def test_a_wrong_scale_is_estimated_for_a_position_in_coarse_counts(coarse: Recording) -> None:
    def scaled(name: str, values: Array) -> Array:
        return 1.1 * values if name == "position_rad" else values

    (fault,) = diagnosed(coarse, (*LINE, "position_rad"), scaled).sensor_faults
    assert (fault.channel, fault.kind) == ("position_rad", "scale")
    assert fault.size == pytest.approx(0.1, abs=0.01)


# A delay of several rows is identifiable in a shorter recording, which takes less time.
# `test_control_errors.py` tests that a delay of late channels is selected, and `test_explanation.py` that one
# delay leaves the gain undecided.
@pytest.mark.evidence
@pytest.mark.parametrize(("rows", "duration"), [(-5, 0.2), (1, 0.3)])
def test_a_delay_of_all_channels_is_not_read_as_a_gain(rows: int, duration: float) -> None:
    def late(_: str, values: Array) -> Array:
        shown = np.roll(values, rows)
        shown[: max(rows, 0)], shown[values.size + min(rows, 0) :] = values[0], values[-1]
        return shown

    check(diagnosed(recorded(duration), LINE, late), "all channels", "delay", rows * 2e-4, 2.5e-5)


@pytest.mark.evidence
@pytest.mark.usefixtures("unrefined")
def test_a_wrong_scale_of_voltage_is_not_read_as_heat(unspoilt: Recording) -> None:
    def halved(name: str, values: Array) -> Array:
        return 0.5 * values if name == "voltage_V" else values

    check(diagnosed(unspoilt, LINE, halved), "voltage_V", "scale", -0.5, 0.03)


def test_a_reversed_channel_is_identified(unspoilt: Recording) -> None:
    def reversed_(name: str, values: Array) -> Array:
        return -values if name == "speed_rad_s" else values

    check(diagnosed(unspoilt, (*LINE, "speed_rad_s"), reversed_), "speed_rad_s", "reversed", -2.0, 0.02)


def test_a_zero_error_of_position_does_not_change_the_start(unspoilt: Recording) -> None:
    def shifted(name: str, values: Array) -> Array:
        return values + 6.3e-3 if name == "position_rad" else values

    check(diagnosed(unspoilt, (*LINE, "position_rad"), shifted), "position_rad", "bias", 6.3e-3, 1e-4)


def test_exchanged_channels_are_identified(unspoilt: Recording) -> None:
    others = {"voltage_V": "speed_rad_s", "speed_rad_s": "voltage_V"}

    def exchanged(name: str, _: Array) -> Array:
        return np.array(unspoilt[others.get(name, name)])

    check(diagnosed(unspoilt, FOUR, exchanged), "voltage_V and speed_rad_s", "swapped", 2.0, 0.0)


def test_a_frozen_current_is_identified_and_its_rows_are_not_compared(unspoilt: Recording) -> None:
    def frozen(name: str, values: Array) -> Array:
        if name == "current_A":
            values[600:900] = values[600]
        return values

    check(diagnosed(unspoilt, LINE, frozen), "current_A", "frozen", 0.06, 1e-3)
