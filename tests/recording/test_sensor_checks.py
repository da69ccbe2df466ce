"""Sensor faults are found from the sensor's own signal; healthy sensors raise no alarm."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp, Faults, Sine, Step
from emaphm.arrays import Array
from emaphm.errors import RecordingError
from emaphm.recording import Recording, read_recording, with_equivalent_current, write_recording
from emaphm.recording.resampling import on_uniform_grid
from emaphm.recording.schema import PHASES
from emaphm.recording.sensor_checks import check_sensors
from emaphm.recording.sensor_checks.clipping import clipped_rows
from emaphm.recording.sensor_checks.freezing import frozen_rows
from emaphm.recording.sensor_checks.held_samples import held_rows, interpolated
from emaphm.simulated_recording import simulate

LINE = ("time_s", "command_rad", "current_A", "voltage_V", "position_rad", "speed_rad_s")
OF_PHASES = ("time_s", "command_rad", *PHASES, "angle_rad", "voltage_V")


@pytest.fixture(scope="module")
def healthy_recording() -> Recording:
    return simulate(THESIS, Chirp(), noise=0.05, adc_bits=12)


def with_fault(
    recording: Recording, names: tuple[str, ...], spoil: Callable[[dict[str, Array]], None]
) -> Recording:
    columns = {name: np.array(recording[name]) for name in names}
    spoil(columns)
    return Recording(columns)


def kinds(recording: Recording) -> list[tuple[str, str]]:
    return [(finding.channel, finding.kind) for finding in check_sensors(recording, THESIS).findings]


@pytest.mark.parametrize("bits", [None, 8, 12])
@pytest.mark.parametrize("faults", [Faults(), Faults(friction=0.8, short_b=0.5, eccentricity=0.4)])
def test_a_healthy_sensor_raises_no_alarm(faults: Faults, bits: int | None) -> None:
    for noise in (0.0, 0.05):
        recording = simulate(THESIS, Chirp(), faults=faults, noise=noise, adc_bits=bits)
        for names in (LINE, OF_PHASES):
            assert kinds(Recording({name: recording[name] for name in names})) == [], names


@pytest.mark.parametrize("amplitude", [5e-5, 2e-4, 5e-4])
@pytest.mark.parametrize("rate", [1000.0, 5000.0, 20000.0])
@pytest.mark.parametrize("about", [0.0, 0.3])
def test_a_shaft_held_by_friction_at_reversals_is_no_frozen_sensor(
    amplitude: float, rate: float, about: float
) -> None:
    recording = simulate(
        THESIS,
        Chirp(amplitude, about=about),
        sample_rate=rate,
        initial_position=about,
        faults=Faults(friction=1),
    )
    assert kinds(Recording({name: recording[name] for name in (*LINE, "angle_rad")})) == []


@pytest.mark.parametrize("noise", [0.0, 1e-8, 1e-7])
@pytest.mark.parametrize("first", [600, 700, 1150])
def test_a_position_that_freezes_near_a_reversal_is_found(first: int, noise: float) -> None:
    exact = simulate(THESIS, Chirp(2e-4))
    position = exact["position_rad"] + noise * np.random.default_rng(0).standard_normal(exact.samples)
    last = first + 300
    position[first:last] = position[first]
    frozen = frozen_rows(position, "position_rad", exact["command_rad"], THESIS)
    assert frozen[first + 1 : last].all()
    assert not frozen[:600].any()
    assert not frozen[last:].any()


def test_a_resting_actuator_raises_no_alarm() -> None:
    # The shaft moves to a position and stays there: position, speed and voltage no longer change.
    def there(t: Array) -> Array:
        return 5e-3 * np.clip(t / 0.05, 0.0, 1.0)

    recording = simulate(THESIS, there, duration=0.4, noise=0.05, adc_bits=12)
    assert kinds(Recording({name: recording[name] for name in LINE})) == []


@pytest.mark.parametrize(
    ("actuator", "bits"),
    [(THESIS, None), (Actuator.load("six-step"), 16), (Actuator.pmsm(), 12)],
    ids=["thesis", "six-step", "pmsm"],
)
def test_an_actuator_that_settles_at_a_constant_command_raises_no_alarm(
    actuator: Actuator, bits: int | None
) -> None:
    # A step at the start: all rows of the command are equal.
    recording = simulate(actuator, Step(3e-3), duration=0.5, sample_rate=1000.0, adc_bits=bits)
    line = Recording({name: recording[name] for name in LINE if name in recording})
    assert np.ptp(line["command_rad"]) == 0
    assert check_sensors(line, actuator).findings == ()


@pytest.mark.parametrize("actuator", [Actuator.pmsm(), Actuator.dc()], ids=["pmsm", "dc"])
@pytest.mark.parametrize("bits", [None, 12])
def test_an_actuator_that_rests_until_its_command_jumps_raises_no_alarm(
    actuator: Actuator, bits: int | None
) -> None:
    def square(t: Array) -> Array:
        return 5e-3 * np.sign(np.sin(2 * np.pi * 5.0 * t - 0.1))

    recording = simulate(actuator, square, noise=0.05, adc_bits=bits)
    line = Recording({name: recording[name] for name in LINE if name in recording})
    assert check_sensors(line, actuator).findings == ()


@pytest.mark.parametrize(
    ("actuator", "amplitude", "frequency"),
    [(THESIS, 0.1, 2.0), (THESIS, 0.02, 8.0), (Actuator.dc(), 0.1, 4.0), (Actuator.pmsm(), 0.1, 4.0)],
    ids=["long", "fast", "dc", "pmsm"],
)
@pytest.mark.parametrize("bits", [None, 12])
def test_a_drive_at_its_limits_raises_no_alarm(
    actuator: Actuator, amplitude: float, frequency: float, bits: int | None
) -> None:
    # Strokes for which the full supply, current or speed is not sufficient.
    recording = simulate(actuator, Sine(amplitude, frequency), model="averaged", adc_bits=bits)
    line = Recording({name: recording[name] for name in LINE if name in recording})
    assert check_sensors(line, actuator).findings == ()


@pytest.mark.parametrize("rows", [20, 100])
def test_a_channel_that_freezes_early_is_found(rows: int) -> None:
    phase = 2 * np.pi * np.arange(2500) / 1000
    noise = np.random.default_rng(0).normal(0.0, 0.05, phase.size)
    current = np.round((3.0 * np.cos(phase) + noise) / 0.01) * 0.01
    current[rows:] = current[rows]
    frozen = frozen_rows(current, "current_A", np.sin(phase), THESIS)
    np.testing.assert_array_equal(np.flatnonzero(frozen), np.arange(rows + 1, phase.size))


@pytest.mark.parametrize("name", LINE[2:])
def test_a_frozen_channel_is_found_and_its_rows_are_discarded(
    healthy_recording: Recording, name: str
) -> None:
    def freeze(columns: dict[str, Array]) -> None:
        columns[name][1000:1500] = columns[name][1000]

    checked = check_sensors(with_fault(healthy_recording, LINE, freeze), THESIS)
    (finding,) = checked.findings
    assert (finding.channel, finding.kind) == (name, "frozen")
    assert finding.size == pytest.approx(0.1, abs=0.002)  # a signal may repeat its value before and after
    assert checked.unusable[name][1001:1500].all()
    assert finding.sentence in checked.recording.notes


@pytest.mark.parametrize("name", ["current_A", "position_rad", "speed_rad_s"])
def test_a_clipped_channel_is_found(healthy_recording: Recording, name: str) -> None:
    def clip(columns: dict[str, Array]) -> None:
        limit = 0.7 * np.abs(columns[name]).max()
        columns[name] = np.clip(columns[name], -limit, limit)

    checked = check_sensors(with_fault(healthy_recording, LINE, clip), THESIS)
    assert (name, "clipped") in [(item.channel, item.kind) for item in checked.findings]
    finding = next(item for item in checked.findings if item.kind == "clipped")
    assert finding.size == pytest.approx(0.7 * np.abs(healthy_recording[name]).max())


def test_all_rows_at_the_end_of_a_range_are_discarded() -> None:
    # The first and the last plateau have no rows on one side from which to see their slopes.
    command = np.sin(2 * np.pi * np.arange(4000) / 1000)
    values = np.clip(2 * command, -0.95, 0.95)
    discarded = clipped_rows(values, "speed_rad_s", command, THESIS)
    np.testing.assert_array_equal(discarded, np.abs(values) == 0.95)


def test_lost_samples_are_found_and_interpolated() -> None:
    # A clean sine: the lost values are known, and linear interpolation has only the error of the curvature.
    true = np.sin(2 * np.pi * np.arange(1000) / 200)
    lost = np.arange(5, 1000, 50)
    values = true.copy()
    values[lost] = values[lost - 1]
    held = held_rows(values)
    moving = np.abs(np.diff(true, prepend=0.0)) > 0.2 * np.abs(np.diff(true)).max()
    np.testing.assert_array_equal(held[moving], np.isin(np.arange(1000), lost)[moving])
    curvature = (2 * np.pi / 200) ** 2 / 2
    np.testing.assert_allclose(interpolated(values, held)[moving], true[moving], atol=curvature)
    assert not held_rows(true).any()


def test_lost_samples_of_a_noisy_signal_of_fine_counts_are_found() -> None:
    rng = np.random.default_rng(1)
    true = np.sin(2 * np.pi * np.arange(2500) / 500) + rng.normal(0.0, 0.05, 2500)
    lost = np.arange(7, 2490, 100)
    values = true.copy()
    values[lost] = values[lost - 1]
    np.testing.assert_array_equal(np.flatnonzero(held_rows(values)), lost)
    assert not held_rows(true).any()
    # With counts of half the noise, one value in seven repeats by chance: lost values cannot be identified.
    assert not held_rows(np.round(values / 0.025) * 0.025).any()


@pytest.mark.parametrize("seed", range(4))
def test_a_coarse_signal_between_jittering_rows_has_lost_no_samples(seed: int) -> None:
    # A current in counts of 0.01 A whose rows are resampled: interpolated values lie on no count, but two
    # neighbouring rows of the same count make a repeat.
    rng = np.random.default_rng(seed)
    interval, rows = 5e-3, 1200
    times = interval * (np.arange(rows) + rng.uniform(0.0, 0.2, rows))
    phase = np.pi * (0.4 * times + 0.3 * times**2)
    current = np.round((0.4 * np.sin(phase) + rng.normal(0.0, 0.004, rows)) / 0.01) * 0.01
    resampled, notes = on_uniform_grid({"time_s": times, "current_A": current}, "instant")
    assert notes
    repeats = np.count_nonzero(np.diff(resampled["current_A"]) == 0)
    assert repeats > 20
    assert not held_rows(resampled["current_A"]).any()


def test_lost_samples_of_a_smooth_signal_in_counts_are_found() -> None:
    exact = 800 * np.sin(2 * np.pi * np.arange(1000) / 1000)
    true = np.round(exact)
    lost = np.arange(20, 990, 35)
    spoilt = true.copy()
    spoilt[lost] = spoilt[lost - 1]
    # At four counts per row or more, a repeated value is not from rounding; at slower motion it may be.
    held, moving = held_rows(spoilt), np.abs(np.diff(exact, prepend=exact[0])) > 4
    np.testing.assert_array_equal(np.flatnonzero(held & moving), lost[moving[lost]])
    assert np.isin(np.flatnonzero(held), lost).all()
    assert not held_rows(true).any()


def test_an_exact_position_held_by_backlash_at_reversals_has_lost_no_samples() -> None:
    # A sine of 63 rows a period, behind a backlash that the motor crosses in 1.7 rows.
    motor, half = np.sin(0.1 * np.arange(4000)), (1 - np.cos(0.17)) / 2
    user = np.empty_like(motor)
    last = 0.0
    for row, angle in enumerate(motor):
        last = user[row] = np.clip(last, angle - half, angle + half)
    assert np.count_nonzero(np.diff(user) == 0) > 50
    assert not held_rows(user).any()


def test_a_drive_that_switches_cyclically_raises_no_alarm() -> None:
    # Six voltages in turn, two of them adjacent and equal: they repeat, and return to the largest.
    voltage = np.tile([-0.3, 4.8, 1.4, 1.4, 5.5, 0.5], 300)
    command = np.linspace(0.0, 1.0, voltage.size)
    assert not held_rows(voltage).any()
    assert not clipped_rows(voltage, "voltage_V", command, THESIS).any()


@pytest.mark.parametrize("rounded", [0.0, 1e-9])
def test_a_cycle_temporarily_synchronous_with_the_rows_raises_no_alarm(rounded: float) -> None:
    # Two switched voltages in turn, the lower voltage mostly in two rows, within a voltage with ripple;
    # the mean over an interval is rounded differently in each cycle.
    rng = np.random.default_rng(4)
    ripple = np.round(rng.normal(0.0, 2.0, 5000), 4)
    cycles = np.where(rng.random(400) < 0.1, 2, 3)
    locked = np.concatenate([np.repeat([0.0, 2.4], [cycle - 1, 1]) for cycle in cycles])
    locked += rounded * np.repeat(rng.random(400), cycles)
    assert not held_rows(np.concatenate([ripple[:2500], locked, ripple[2500:]])).any()


def test_a_phase_at_zero_while_it_does_not_conduct_raises_no_alarm() -> None:
    # It pauses at 0 before each half wave, at times for no longer than a loss of samples would.
    half = np.sin(np.pi * np.linspace(0.1, 0.97, 60))
    pauses = [10, 4, 10, 3, 10, 4, 10, 3]
    current = np.concatenate([np.append((-1) ** k * half, np.zeros(rows)) for k, rows in enumerate(pauses)])
    assert not held_rows(current).any()


def test_a_noisy_channel_clipped_in_single_rows_is_found() -> None:
    rng = np.random.default_rng(2)
    count = 0.02
    true = np.round(rng.normal(0.0, 2.0, 2500) / count) * count
    command = np.linspace(0.0, 1.0, true.size)
    # 1.2 % of a normal distribution lie beyond 2.5 deviations: some 16 rows either way, hardly two in a row.
    clipped = clipped_rows(np.clip(true, -5.0, 5.0), "voltage_V", command, THESIS)
    np.testing.assert_array_equal(clipped, np.abs(true) >= 5.0)
    assert not clipped_rows(true, "voltage_V", command, THESIS).any()


def test_a_jam_is_no_frozen_sensor() -> None:
    # The position stays where the actuator jams to the end; the data do not indicate a frozen sensor.
    command = np.sin(2 * np.pi * np.arange(1000) / 500)
    position = np.where(np.arange(1000) < 300, command, command[300])
    assert not frozen_rows(position, "position_rad", command, THESIS).any()


@pytest.mark.parametrize("marks", [380, 400, 420])
def test_a_speed_that_counts_the_marks_of_an_encoder_is_no_frozen_sensor(marks: int) -> None:
    # At one mark per row, the value repeats for a hundred rows; elsewhere it changes by single counts.
    phase = 2 * np.pi * 15 * (np.arange(2500) / 5000) ** 2
    speed = np.diff(np.floor(marks * np.sin(phase)), prepend=0.0)
    assert not frozen_rows(speed, "speed_rad_s", np.sin(phase), THESIS).any()


def test_a_frozen_sensor_with_noise_as_large_as_its_counts_is_found() -> None:
    rng = np.random.default_rng(3)
    phase = 2 * np.pi * np.arange(2500) / 1000
    speed = np.round(20.0 * np.cos(phase) + rng.normal(0.0, 0.9, phase.size))
    speed[800:1200] = speed[800]
    speed[1200] += 1
    frozen = frozen_rows(speed, "speed_rad_s", np.sin(phase), THESIS)
    np.testing.assert_array_equal(np.flatnonzero(frozen), np.arange(801, 1200))


@pytest.mark.parametrize("noise", [0.0, 0.2, 0.4])
@pytest.mark.parametrize("speed", [0.6, 0.9, 1.1, 1.5])
def test_a_position_that_moves_by_a_count_a_row_has_lost_no_samples(speed: float, noise: float) -> None:
    # Two reversing motions in counts, fast and slow, with sines whose periods are no whole number of rows.
    rows, rng = np.arange(3000), np.random.default_rng(7)
    counts = 30 * speed * np.sin(rows / 30) + 40 * speed * np.sin(rows / 77.7)
    position = np.round(counts + noise * rng.normal(size=rows.size)) * 3.66e-5
    assert not held_rows(position).any()


def test_a_shaft_held_by_an_end_stop_is_no_clipped_sensor() -> None:
    mechanics = THESIS.mechanics.model_copy(update={"end_stops": (0.1, 1.0)})
    retracted = THESIS.model_copy(update={"mechanics": mechanics})
    pushed = simulate(retracted, Chirp(about=0.101), noise=0.05, adc_bits=12)
    assert np.ptp(pushed["position_rad"]) < 0.8 * np.ptp(pushed["command_rad"])
    for names in (LINE, OF_PHASES):
        assert not check_sensors(Recording({name: pushed[name] for name in names}), retracted).findings


@pytest.mark.parametrize("stops", [(-0.5236, 0.5236), (0.0, 0.51)])
def test_a_position_clipped_near_an_end_stop_is_found(stops: tuple[float, float]) -> None:
    mechanics = THESIS.mechanics.model_copy(update={"end_stops": stops})
    machine = THESIS.model_copy(update={"mechanics": mechanics})
    moved = simulate(machine, Chirp(about=0.49), noise=0.05, adc_bits=16)
    columns = {name: moved[name] for name in LINE}
    columns["position_rad"] = np.minimum(columns["position_rad"], 0.493)
    (finding,) = check_sensors(Recording(columns), machine).findings
    assert (finding.channel, finding.kind) == ("position_rad", "clipped")


def test_a_channel_limited_by_the_hardware_raises_no_alarm() -> None:
    command = np.sin(2 * np.pi * np.arange(1000) / 200)
    speed = 2 * THESIS.controller.speed_limit * command if THESIS.controller.speed_limit else command
    limit = THESIS.controller.speed_limit
    assert limit is not None
    assert not clipped_rows(np.clip(speed, -limit, limit), "speed_rad_s", command, THESIS).any()
    assert clipped_rows(np.clip(speed, -0.8 * limit, 0.8 * limit), "speed_rad_s", command, THESIS).any()


def test_a_phase_with_a_wrong_scale_is_replaced_from_the_other_phases(healthy_recording: Recording) -> None:
    def scale(columns: dict[str, Array]) -> None:
        columns["current_b_A"] = 1.2 * columns["current_b_A"]

    checked = check_sensors(with_fault(healthy_recording, OF_PHASES, scale), THESIS)
    (finding,) = checked.findings
    assert (finding.channel, finding.kind) == ("current_b_A", "scale")
    assert finding.size == pytest.approx(0.2, abs=0.01)
    # Two sensors' noise and counts, five standard deviations.
    error = checked.recording["current_b_A"] - healthy_recording["current_b_A"]
    assert np.abs(error).max() < 5 * 3**0.5 * 0.06


def test_a_reversed_phase_is_found(healthy_recording: Recording) -> None:
    def reverse(columns: dict[str, Array]) -> None:
        columns["current_c_A"] = -columns["current_c_A"]

    assert kinds(with_fault(healthy_recording, OF_PHASES, reverse)) == [("current_c_A", "reversed")]


@pytest.mark.parametrize("order", [(1, 0, 2), (2, 1, 0), (1, 2, 0)])
def test_exchanged_phases_are_corrected(healthy_recording: Recording, order: tuple[int, ...]) -> None:
    def swap(columns: dict[str, Array]) -> None:
        columns.update({name: healthy_recording[PHASES[i]] for name, i in zip(PHASES, order, strict=True)})

    checked = check_sensors(with_fault(healthy_recording, OF_PHASES, swap), THESIS)
    assert [finding.kind for finding in checked.findings] == ["swapped"]
    for name in PHASES:
        np.testing.assert_array_equal(checked.recording[name], healthy_recording[name])


def _frozen_b(columns: dict[str, Array]) -> None:
    columns["current_b_A"][600:900] = columns["current_b_A"][600]


def _reversed_b(columns: dict[str, Array]) -> None:
    columns["current_b_A"] *= -1


def _exchanged(columns: dict[str, Array]) -> None:
    columns["current_a_A"], columns["current_b_A"] = columns["current_b_A"], columns["current_a_A"]


@pytest.mark.parametrize("spoil", [_frozen_b, _reversed_b, _exchanged])
def test_phases_used_for_the_equivalent_current_are_checked(
    healthy_recording: Recording, spoil: Callable[[dict[str, Array]], None], tmp_path: Path
) -> None:
    in_memory = with_fault(healthy_recording, OF_PHASES, spoil)
    write_recording(in_memory, tmp_path / "phases.csv")
    from_file = read_recording(tmp_path / "phases.csv", THESIS)
    assert "current_A" in from_file
    expected, checked = check_sensors(in_memory, THESIS), check_sensors(from_file, THESIS)
    assert [result.sentence for result in checked.findings] == [
        result.sentence for result in expected.findings
    ]
    assert checked.findings
    corrected, right = (with_equivalent_current(result.recording, THESIS) for result in (checked, expected))
    np.testing.assert_array_equal(corrected["current_A"], right["current_A"])
    assert checked.unusable.keys() == expected.unusable.keys()
    for name, rows in expected.unusable.items():
        np.testing.assert_array_equal(checked.unusable[name], rows)


def test_a_measured_current_is_checked_although_the_phases_were_recorded(
    healthy_recording: Recording,
) -> None:
    def freeze(columns: dict[str, Array]) -> None:
        columns["current_A"][600:900] = columns["current_A"][600]

    assert kinds(with_fault(healthy_recording, (*OF_PHASES, "current_A"), freeze)) == [
        ("current_A", "frozen")
    ]


def test_a_recording_whose_current_is_mostly_frozen_is_refused(healthy_recording: Recording) -> None:
    def freeze(columns: dict[str, Array]) -> None:
        columns["current_A"][600:2200] = columns["current_A"][600]

    with pytest.raises(RecordingError, match=r"current_A is frozen .* record it again"):
        check_sensors(with_fault(healthy_recording, LINE, freeze), THESIS)
