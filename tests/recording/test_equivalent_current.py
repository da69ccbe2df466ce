"""The three forms of the equivalent current, compared with closed forms."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emaphm.actuator import Actuator, Chirp
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.errors import RecordingError
from emaphm.recording import (
    Recording,
    equivalent_current,
    read_recording,
    sinusoidal_equivalent_current,
    with_equivalent_current,
)
from emaphm.recording.equivalent_current import Form
from emaphm.recording.schema import PHASES
from emaphm.simulated_recording import simulate

from .conftest import Columns, Refusal

FORMS: tuple[Form, ...] = ("torque", "active", "magnitude")

# The phase with the incoming and the phase with the outgoing current, in each sixth of an electrical turn
# from 30 deg on: the standard commutation table of BLDC drives.
SECTORS = [(0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1)]


@pytest.mark.parametrize("form", FORMS)
@given(
    sector=st.integers(0, 5),
    inside=st.floats(0.01, 0.99),
    turns=st.integers(-50, 50),
    current=st.floats(-30, 30),
    pole_pairs=st.integers(1, 8),
)
def test_two_conducting_phases_on_their_flat_tops_give_the_equivalent_current(
    form: Form, sector: int, inside: float, turns: int, current: float, pole_pairs: int
) -> None:
    electrical = np.deg2rad(30 + 60 * (sector + inside)) + 2 * np.pi * turns
    phases = np.zeros((3, 1))
    into, out_of = SECTORS[sector]
    phases[into], phases[out_of] = current, -current
    result = equivalent_current(phases, np.array([electrical / pole_pairs]), pole_pairs, form)
    # 1e-9 is far above the rounding of some 300 rad, far below anything physical.
    assert result[0] == pytest.approx(current, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    ("form", "mean"),
    # Means over a turn of balanced unit sinusoids in phase with the trapezoids; the trapezoid's
    # fundamental is 12/pi², that of the commutation 2 sqrt(3)/pi, and the mean of |sin| 2/pi.
    [("torque", 9 / np.pi**2), ("active", 1.5 * np.sqrt(3) / np.pi), ("magnitude", 3 / np.pi)],
)
def test_balanced_sinusoids_give_the_closed_form_means(form: Form, mean: float) -> None:
    electrical = np.linspace(0, 2 * np.pi, 36000, endpoint=False) + 1e-5
    shifts = 2 * np.pi / 3 * np.arange(3)[:, None]
    current = equivalent_current(np.sin(electrical - shifts), electrical / 3, 3, form)
    # The commutation jumps 4 times in 36000 points: the error of the sum is at most 4/36000.
    assert current.mean() == pytest.approx(mean, abs=2e-4)


@pytest.mark.parametrize("form", FORMS)
def test_reversing_the_currents_reverses_the_result(form: Form) -> None:
    rng = np.random.default_rng(0)
    phases, angle = rng.normal(size=(3, 500)), rng.uniform(-20, 20, 500)
    np.testing.assert_allclose(
        equivalent_current(-phases, angle, 2, form), -equivalent_current(phases, angle, 2, form)
    )


def test_ripple_in_the_idle_phase_biases_only_the_magnitude_form() -> None:
    angle = np.full(1000, np.deg2rad(60.0))  # phase c passes through the zero of its trapezoid
    ripple = np.where(np.arange(1000) % 2, 0.5, -0.5)
    phases = np.stack([5 - ripple / 2, -5 - ripple / 2, ripple])
    assert equivalent_current(phases, angle, 1, "torque").mean() == pytest.approx(5.0)
    assert equivalent_current(phases, angle, 1, "active").mean() == pytest.approx(5.0)
    assert equivalent_current(phases, angle, 1, "magnitude").mean() == pytest.approx(5.25)


def test_a_misspelt_form_and_a_wrong_shape_are_refused(refusal: Refusal) -> None:
    zeros = np.zeros((3, 5))
    text = refusal(lambda: equivalent_current(zeros, np.zeros(5), 2, "torqe"))  # type: ignore[arg-type]
    assert "'torque'" in text
    text = refusal(lambda: equivalent_current(zeros.T, np.zeros(5), 2))
    assert "(5, 3)" in text
    assert "three rows" in text


def _phase_csv(columns: Columns, folder: Path) -> Path:
    """Write a rig's file with block-shaped phase currents of 3 A instead of the equivalent current."""
    electrical = np.deg2rad(30 + 60 * (np.arange(2500) % 6 + 0.5))
    phases = np.zeros((3, 2500))
    for row in range(2500):
        into, out_of = SECTORS[row % 6]
        phases[into, row], phases[out_of, row] = 3.0, -3.0
    table = np.column_stack([columns["time_s"], columns["command_rad"], electrical / 2, *phases])
    path = folder / "phases.csv"
    header = "time_s,command_rad,angle_rad,current_a_A,current_b_A,current_c_A"
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.17g")
    return path


def test_the_reader_computes_the_equivalent_current_from_the_phases(
    columns: Columns, tmp_path: Path, thesis: Actuator
) -> None:
    recording = read_recording(_phase_csv(columns, tmp_path), thesis)
    np.testing.assert_allclose(recording["current_A"], 3.0)
    assert "current_b_A" in recording


@pytest.mark.parametrize(
    ("step_deg", "per_row", "notes"),
    [
        (9.0, 0.01, ["angle_rad has steps of 9 degrees electrical"]),
        (1.0, 0.01, []),
        (0.0, 0.01, []),
        # Differences between rows as large as such steps, but from the motion.
        (0.0, 0.3, []),
    ],
)
def test_an_angle_in_coarse_steps_has_a_note(
    step_deg: float, per_row: float, notes: list[str], thesis: Actuator
) -> None:
    angle = per_row * np.arange(2500.0)
    step = np.radians(step_deg) / 2  # two pole pairs
    recorded = np.round(angle / step) * step if step_deg else angle
    phases = dict.fromkeys(PHASES, np.sin(angle))
    time = np.arange(2500) / 5000
    recording = Recording({"time_s": time, "command_rad": np.sin(time), "angle_rad": recorded, **phases})
    noted = with_equivalent_current(recording, thesis).notes
    assert [note.partition(":")[0] for note in noted] == notes


def test_unusable_phases_have_a_note_if_another_channel_is_recorded(
    columns: Columns, thesis: Actuator
) -> None:
    given = {name: columns[name] for name in ("time_s", "command_rad", "position_rad")}
    recording = Recording(given | {"current_a_A": columns["current_A"]})
    noted = with_equivalent_current(recording, thesis)
    assert noted.names == recording.names
    (note,) = noted.notes
    assert "not compared: no current_b_A, current_c_A, angle_rad" in note
    # A second call does not repeat the note.
    assert with_equivalent_current(noted, thesis).notes == noted.notes


def test_without_pole_pairs_the_other_channels_are_kept(columns: Columns, thesis: Actuator) -> None:
    ideal = thesis.model_copy(update={"electrical": None})
    phases = dict.fromkeys(("current_a_A", "current_b_A", "current_c_A"), columns["current_A"])
    given = {name: columns[name] for name in ("time_s", "command_rad", "position_rad")}
    recording = Recording({**given, **phases, "angle_rad": 500 * columns["position_rad"]})
    (note,) = with_equivalent_current(recording, ideal).notes
    assert "pole pairs" in note


def test_the_reader_needs_pole_pairs_for_the_equivalent_current(
    columns: Columns, tmp_path: Path, thesis: Actuator, refusal: Refusal
) -> None:
    ideal = thesis.model_copy(update={"electrical": None})
    text = refusal(lambda: read_recording(_phase_csv(columns, tmp_path), ideal))
    assert "phases.csv" in text
    assert "pole pairs" in text
    assert "[electrical]" in text


@given(
    electrical=st.floats(-50, 50),
    current=st.floats(-30, 30),
    flux=st.floats(-30, 30),
    pole_pairs=st.integers(1, 8),
)
def test_the_equivalent_current_of_a_sine_motor_is_in_phase_with_the_back_emf(
    electrical: float, current: float, flux: float, pole_pairs: int
) -> None:
    # A current across the back-EMF makes no torque; the amplitude of the phases is 2/√3 of the line value.
    shifts = electrical - 2 * np.pi / 3 * np.arange(3)[:, None]
    phases = 2 / np.sqrt(3) * (current * np.sin(shifts) + flux * np.cos(shifts))
    result = sinusoidal_equivalent_current(phases, np.array([electrical / pole_pairs]), pole_pairs)
    assert result[0] == pytest.approx(current, rel=1e-9, abs=1e-9)


def test_the_type_of_drive_selects_the_form_of_the_equivalent_current() -> None:
    recording = simulate(Actuator.pmsm(), Chirp(), duration=0.05)
    names = ("time_s", "command_rad", "angle_rad", "current_a_A", "current_b_A", "current_c_A")
    phases = Recording({name: recording[name] for name in names})
    current = with_equivalent_current(phases, Actuator.pmsm())["current_A"]
    # Means over 200 µs of phases and angle; the angle turns by at most 0.05 rad in this time.
    scale = np.abs(recording["current_A"]).max()
    np.testing.assert_allclose(current, recording["current_A"], rtol=0, atol=2e-3 * scale)
    trapezoidal = with_equivalent_current(phases, Actuator.thesis())["current_A"]
    assert np.abs(trapezoidal - current).max() > 0.02 * scale


@pytest.mark.parametrize("kind", ["thesis", "pmsm"])
def test_the_rotor_zero_is_added_to_the_recorded_angle(kind: str) -> None:
    described = Actuator.thesis() if kind == "thesis" else Actuator.pmsm()
    assert described.electrical is not None
    turned = with_lumped_parameters(described, {"rotor_zero": 0.6})
    angle = np.linspace(0.0, 9.0, 300)
    currents = {f"current_{phase}_A": np.cos(angle + i) for i, phase in enumerate("abc")}
    rows = {"time_s": np.arange(300) * 1e-3, "command_rad": angle, **currents}
    before = Recording({**rows, "angle_rad": angle + 0.6 / described.electrical.pole_pairs})
    after = with_equivalent_current(Recording({**rows, "angle_rad": angle}), turned)["current_A"]
    np.testing.assert_allclose(after, with_equivalent_current(before, described)["current_A"], atol=1e-12)


def test_phases_that_do_not_fit_the_angle_are_refused() -> None:
    with pytest.raises(RecordingError, match="give three rows"):
        sinusoidal_equivalent_current(np.zeros((2, 5)), np.zeros(5), 2)
