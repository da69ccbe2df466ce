"""Calibration in closed loop or by measured motion: the choice between them, and estimates by both."""

import json

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.actuator.unit.tolerances import Tolerances
from emaphm.calibration import CampaignRow, calibrate
from emaphm.calibration.motion.fit import coordinates, measured_start
from emaphm.calibration.motion.result import described_for_motion
from emaphm.calibration.unit_fit import NO_START
from emaphm.errors import MethodError
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

FREE = ("inertia", "viscous", "coulomb", "offset")
UNIT = with_lumped_parameters(
    THESIS, {"inertia": 3.2e-5, "viscous": 2e-4, "coulomb": 0.06, "offset": 0.02}, name="unit"
)
TRUE = lumped_parameters(UNIT, FREE)
DURATION = 0.3
WRONG_GAIN = with_lumped_parameters(THESIS, {"position_gain": 5e4}, name="other gain")


def recorded(actuator: Actuator, *, stop_hz: float = 15.0, seed: int = 0) -> Recording:
    command = Chirp(stop_hz=stop_hz, duration=DURATION)
    return simulate(actuator, command, duration=DURATION, noise=0.02, seed=seed)


@pytest.fixture(scope="module")
def reference() -> Recording:
    return recorded(UNIT)


def test_a_wrong_gain_leads_to_measured_motion(reference: Recording) -> None:
    calibration = calibrate(reference, WRONG_GAIN, FREE, nuisances=[])
    assert calibration.loop.loop == "measured"
    assert "position gain 9.99" in calibration.loop.reason
    assert "described 5e+04" in calibration.loop.reason
    for name, parameter in calibration.parameters.items():
        assert parameter.identifiable
        assert abs(parameter.value - TRUE[name]) < 3 * parameter.standard_error
        assert parameter.value == pytest.approx(TRUE[name], rel=0.02)
    assert calibration.parameters["inertia"].value == pytest.approx(TRUE["inertia"], rel=2e-3)
    # The noise is 2 % of each channel, and averages out below the cutoff of the regression.
    assert calibration.force_error is not None
    assert calibration.force_error < 0.02
    assert lumped_parameters(calibration.actuator, FREE) == pytest.approx(
        {name: p.value for name, p in calibration.parameters.items()}
    )
    # In closed loop with that gain, the deviation exceeds the standard errors.
    closed = calibrate(reference, WRONG_GAIN, FREE, loop="closed", nuisances=[], max_corrections=0)
    assert closed.loop.loop == "closed"
    assert closed.force_error is None
    assert abs(closed.parameters["inertia"].value / TRUE["inertia"] - 1) > 0.02


def test_the_result_by_measured_motion_is_a_description_a_table_and_json(reference: Recording) -> None:
    calibration = calibrate(reference, THESIS, FREE, loop="measured")
    assert calibration.actuator.name == "thesis, calibrated"
    baseline = calibration.actuator.baseline
    assert baseline is not None
    assert baseline.names == FREE
    for i, (name, parameter) in enumerate(calibration.parameters.items()):
        scale = 1.0 if name == "offset" else parameter.value
        assert np.sqrt(baseline.covariance[i][i]) * scale == pytest.approx(parameter.standard_error, rel=0.01)
    answer = json.loads(calibration.to_json())
    assert (answer["loop"], answer["loop_reason"]) == ("measured", "as asked for")
    assert answer["force_error"] == answer["recordings"][0]["force_error"] == calibration.force_error
    assert calibration.replays[0].relative_error["current_A"] < 0.1
    for piece in ("Calibrated by measured motion: as asked for.", "torque by the measured motion"):
        assert piece in str(calibration)
    Actuator.from_dict(calibration.actuator.model_dump(exclude_none=True), where="calibrated")


def test_the_parameters_with_a_tolerance_are_free_by_default(reference: Recording) -> None:
    data_sheet = THESIS.model_copy(update={"tolerances": Tolerances(inertia=0.1, coulomb=0.3)})
    assert set(calibrate(reference, data_sheet, loop="measured").parameters) == {"inertia", "coulomb"}


def test_with_a_right_description_the_closed_loop_is_used(reference: Recording) -> None:
    calibration = calibrate(reference, THESIS, ["inertia"], max_corrections=0)
    assert calibration.loop.loop == "closed"
    assert "agrees" in calibration.loop.reason
    alone = {name: reference[name] for name in ("time_s", "command_rad", "current_A")}
    unchecked = calibrate(Recording(alone, reference.sampling), THESIS, ["inertia"], max_corrections=0)
    assert unchecked.loop.loop == "closed"
    assert unchecked.loop.reason == "the controller's gains are not identifiable from the recordings"


def test_with_a_free_gain_or_lag_the_closed_loop_is_used(reference: Recording) -> None:
    calibration = calibrate(reference, WRONG_GAIN, ["inertia", "position_gain"], max_corrections=0)
    assert calibration.loop.loop == "closed"
    assert "'position_gain' is free" in calibration.loop.reason
    assert calibration.parameters["position_gain"].value == pytest.approx(1e5, rel=0.01)
    lagging = with_lumped_parameters(WRONG_GAIN, {"torque_lag": 1e-4})
    calibration = calibrate(reference, lagging, ["inertia", "torque_lag"], max_corrections=0)
    assert calibration.loop.loop == "closed"
    assert "does not identify 'torque_lag'" in calibration.loop.reason


@pytest.mark.parametrize(
    ("free", "laws", "loop", "message"),
    [
        (
            ["inertia", "resistance", "backlash"],
            None,
            "measured",
            r"measured motion does not identify 'backlash'",
        ),
        (
            ["inertia", "position_gain"],
            None,
            "measured",
            r"does not identify 'position_gain'; leave it out, or",
        ),
        (["inertia"], ["compliance"], "measured", r"does not identify 'stiffness'"),
        (["inertia"], "auto", "measured", r"name the laws, or calibrate in closed loop"),
        (["inertai"], None, "measured", r"did you mean 'inertia'\?"),
        (["inertia"], None, "mesured", r"unknown loop 'mesured' \(did you mean 'measured'\?\)"),
    ],
)
def test_parameters_not_identifiable_from_measured_motion_are_refused(
    reference: Recording, free: list[str], laws: list[str] | str | None, loop: str, message: str
) -> None:
    with pytest.raises(MethodError, match=message) as caught:
        calibrate(reference, THESIS, free, laws=laws, loop=loop)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


def test_known_values_and_own_parameters_of_recordings_are_used(reference: Recording) -> None:
    weak = with_lumped_parameters(UNIT, {"offset": -0.05})
    other = recorded(weak, stop_hz=11.0)
    rows = [CampaignRow(reference, {"offset": 0.02}), CampaignRow(other, free=("offset",))]
    calibration = calibrate(rows, THESIS, FREE[:3], loop="measured")
    assert calibration.recordings[0].known == {"offset": 0.02}
    assert calibration.recordings[1].own["offset"] == pytest.approx(-0.05, abs=1e-3)
    assert calibration.parameters["inertia"].value == pytest.approx(TRUE["inertia"], rel=2e-3)
    # An unknown load is also estimated for each recording.
    calibration = calibrate([reference, other], THESIS, FREE[:3], loop="measured")
    loads = [recording.nuisances["load"] for recording in calibration.recordings]
    assert loads == pytest.approx([0.02, -0.05], abs=1e-3)
    # The estimated load is added to the described load.
    loaded = with_lumped_parameters(THESIS, {"offset": 0.05})
    (with_described_load,) = calibrate(reference, loaded, FREE[:3], loop="measured").recordings
    assert with_described_load.nuisances["load"] == pytest.approx(-0.03, abs=1e-3)
    assert with_described_load.replay.relative_error["current_A"] == pytest.approx(
        calibration.recordings[0].replay.relative_error["current_A"], rel=0.02
    )


def test_contradicting_recordings_are_doubtful_by_measured_motion(
    reference: Recording,
) -> None:
    heavy = recorded(with_lumped_parameters(UNIT, {"inertia": 6.4e-5}))
    calibration = calibrate([reference, heavy], THESIS, FREE, loop="measured", nuisances=[])
    inertia = calibration.parameters["inertia"]
    assert inertia.doubtful
    assert "alone they would have 3.2e-05 ±" in inertia.reason
    for value in (3.2e-5, 6.4e-5):
        assert abs(inertia.value - value) < 2 * inertia.standard_error
    assert calibration.birge_ratio is not None
    assert calibration.birge_ratio > 10
    again = recorded(UNIT, stop_hz=12.0, seed=1)
    agreeing = calibrate([reference, again], THESIS, FREE, loop="measured")
    assert not agreeing.parameters["inertia"].doubtful
    assert agreeing.parameters["inertia"].value == pytest.approx(TRUE["inertia"], rel=2e-3)


def test_errors_include_the_heat_of_magnets_unless_it_is_known(reference: Recording) -> None:
    unknown = calibrate(reference, THESIS, FREE, loop="measured").parameters["inertia"]
    # 30 K by the prior, and -0.11 %/K by the magnets.
    assert unknown.standard_error / unknown.value == pytest.approx(0.033, rel=0.02)
    assert THESIS.electrical is not None
    warm = CampaignRow(reference, {"temperature": THESIS.electrical.temperature + 50})
    known = calibrate(warm, THESIS, FREE, loop="measured").parameters["inertia"]
    assert known.value == pytest.approx(unknown.value * (1 - 0.055), rel=1e-4)
    assert known.standard_error < 0.003 * known.value


def test_laws_are_estimated_by_measured_motion() -> None:
    description = UNIT.model_dump(exclude_none=True) | {"friction": {"viscous_asymmetry": 0.3}}
    unequal = Actuator.from_dict(description, where="unequal")
    recording = recorded(unequal)
    calibration = calibrate(recording, THESIS, laws=["directional"], loop="measured", nuisances=[])
    assert calibration.laws == ("directional",)
    asymmetry = calibration.parameters["viscous_asymmetry"]
    assert abs(asymmetry.value - 0.3) < 3 * asymmetry.standard_error


def test_the_closed_loop_starts_from_measured_motion_if_possible(reference: Recording) -> None:
    rows = (CampaignRow(reference),)
    start = measured_start(rows, THESIS, (*FREE, "position_gain"), None)
    assert start == pytest.approx(coordinates(THESIS, TRUE), abs=0.02)
    alone = {name: reference[name] for name in ("time_s", "command_rad", "current_A")}
    assert measured_start((CampaignRow(Recording(alone)),), THESIS, FREE, None) == NO_START
    assert measured_start(rows, THESIS, ("position_gain",), None) == NO_START
    # All torques times a common factor give the same current.
    assert measured_start(rows, THESIS, (*FREE, "torque_constant"), None) == NO_START


@pytest.mark.parametrize("known", [{}, {"offset": 0.02}])
def test_a_law_with_the_effect_of_a_load_leaves_a_known_or_unknown_load_out(
    reference: Recording, known: dict[str, float]
) -> None:
    description = described_for_motion([CampaignRow(reference, known)], THESIS, None, ["directional"])
    assert description.free == (
        "inertia", "viscous", "coulomb", "coulomb_asymmetry", "viscous_asymmetry"
    )  # fmt: skip
