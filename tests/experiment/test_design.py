"""Design of a test: the predicted precision, and the improvement by a better manoeuvre."""

import importlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.stats

from cases import THESIS
from emaphm.actuator import NAMES, Actuator, Chirp, Command, DecayingChirp, Sampled, Sine, Step
from emaphm.errors import EmaphmError, OutputError
from emaphm.experiment import Design, candidate_search, design
from emaphm.experiment.candidate_search import PlannedTest, choose_finalist
from emaphm.experiment.excitation import Excitation
from emaphm.experiment.predicted_precision import Precision, predicted_precision
from emaphm.experiment.simulated_tests import Gain, SimulatedTests, simulate_tests
from emaphm.experiment.test_setup import TestSetup
from emaphm.recording import read_signal

EMPS = Actuator.from_toml(Path(__file__).resolve().parents[2] / "examples" / "emps" / "emps.toml")
"""An actuator without electrical section, which has only the components friction and gain."""

THESIS_CHIRP = Excitation(Chirp(), 0.5)

SHORT = 0.1
"""Duration [s] of the poor manoeuvre: as poor as a manoeuvre of half a second, but simulated faster."""


def precision_of(
    manoeuvre: Excitation = THESIS_CHIRP,
    actuator: Actuator = THESIS,
    *,
    channels: tuple[str, ...] = ("current",),
    noise: float = 0.05,
    sample_rate: float = 5000.0,
    count: int = 4,
) -> Precision:
    """Return the predicted precision of `manoeuvre` with `count` fault vectors."""
    conditions = TestSetup.of(actuator, channels, noise, sample_rate, workers=1)
    return predicted_precision(conditions, manoeuvre, conditions.faults(count, seed=3), seed=3)


@pytest.fixture(scope="module")
def improved() -> Design:
    """Return the design for a given chirp up to 2 Hz, with a frequency limit of 15 Hz."""
    poor = Chirp(5e-3, 0.0, 2.0, SHORT)
    return design(THESIS, poor, duration=SHORT, max_frequency=15.0, candidates=1, tests=4, workers=1)


def linear_design(workers: int) -> Design:
    chirp = Chirp(stop_hz=9.0, duration=0.1)
    return design(EMPS, chirp, duration=0.1, noise=0.02, candidates=2, tests=4, seed=2, workers=workers)


@pytest.fixture(scope="module")
def linear() -> Design:
    """Return the design for an actuator without electrical section."""
    return linear_design(workers=1)


@pytest.mark.evidence
def test_expected_intervals_are_those_of_diagnoses_of_reference_recordings() -> None:
    conditions = TestSetup.of(THESIS, ("current",), 0.05, 5000.0, workers=1)
    faults, chirp = conditions.faults(4, seed=11), Excitation(Chirp(duration=0.25), 0.25)
    predicted = predicted_precision(conditions, chirp, faults, seed=5)
    simulated = simulate_tests(conditions, [chirp], tests=4, seed=11)[0].precision
    ratios = [simulated.half_widths[name] / predicted.half_widths[name] for name in NAMES]
    # Two draws of the residual and of the derivatives' points differ by about a fifth. The intervals of a
    # diagnosis whose correction has not settled are wider.
    assert 0.5 < np.median(ratios) < 2
    assert 0.5 < np.exp(np.median(simulated.logarithms - predicted.logarithms)) < 2
    # The intervals of gain and shorts differ by a factor of thirty, which has to be predicted too.
    sizes = [[np.log(widths.half_widths[name]) for name in NAMES] for widths in (predicted, simulated)]
    assert np.corrcoef(sizes)[0, 1] > 0.9


def test_voltage_narrows_the_intervals() -> None:
    alone, with_voltage = precision_of(), precision_of(channels=("current", "voltage"))
    assert with_voltage.logarithms.mean() < alone.logarithms.mean()
    # Heat and a short look alike from the current alone; voltage separates them (docs/physics.md, section 6).
    for name in ("short_a", "short_b", "short_c"):
        assert with_voltage.half_widths[name] < alone.half_widths[name] / 3


LINEAR_CHIRP = Excitation(Chirp(stop_hz=6.0, duration=0.25), 0.25)


@pytest.fixture(scope="module")
def base() -> Precision:
    return precision_of(LINEAR_CHIRP, EMPS, noise=0.2, count=48)


@pytest.mark.parametrize(
    ("noise", "sample_rate", "ratio"), [(0.4, 5000.0, 2.0), (0.2, 2500.0, 2**0.5), (0.4, 20000.0, 1.0)]
)
def test_intervals_are_as_wide_as_noise_and_rows_demand(
    base: Precision, noise: float, sample_rate: float, ratio: float
) -> None:
    # With white noise only, they are proportional to its rms, and to the root of the sampling interval.
    changed = precision_of(LINEAR_CHIRP, EMPS, noise=noise, sample_rate=sample_rate, count=48)
    # Only a few percent of the rows depend on the gain, so that one draw of noise determines its width to a
    # third, and the ratio of 48 widths to 7 %; less for the mean with friction, on which all rows depend.
    measured_ratio = np.exp(np.mean(changed.logarithms - base.logarithms))
    assert measured_ratio == pytest.approx(ratio, rel=0.15)


def test_all_manoeuvres_have_the_same_faults_and_noise() -> None:
    noises = []
    for manoeuvre in (Excitation(Chirp(), 0.1), Excitation(Sine(3e-3, 9.0), 0.05)):
        quiet, loud = (
            TestSetup.of(THESIS, ("current",), noise, 5000.0).record(manoeuvre, np.zeros((2, 8)), seed=4)
            for noise in (0.01, 0.02)
        )
        noises.append([b["current_A"] - a["current_A"] for a, b in zip(quiet, loud, strict=True)])
    for long, short in zip(*noises, strict=True):
        np.testing.assert_allclose(long[: short.size], short, atol=1e-12)  # of some 10 A, to rounding
    assert np.std(noises[0][0]) == pytest.approx(0.01, rel=0.15)  # three standard errors of 500 rows
    # The noises of two fault vectors are independent: three standard errors of a correlation of 500 rows.
    assert np.mean(noises[0][0] * noises[0][1]) == pytest.approx(0.0, abs=0.135 * 0.01**2)


def test_faults_are_the_healthy_ones_and_others_that_fill_their_range() -> None:
    faults = TestSetup.of(THESIS, ("current",), 0.05, 5000.0).faults(16, seed=0)
    np.testing.assert_array_equal(faults[0], [0, 0, 0, 0, 0, 0, 0.5, 0.5])
    assert np.all((faults >= 0) & (faults <= [1, 1, 0.7, 0.7, 0.7, 1, 1, 1]))
    assert np.all(np.ptp(faults[1:], axis=0) > 0.6)
    assert len(np.unique(faults, axis=0)) == 16


def test_a_poor_manoeuvre_is_improved(improved: Design) -> None:
    assert improved.better
    assert improved.gain is not None
    assert improved.gain.narrower > np.log(2)
    given, designed = improved.given.simulated, improved.found.simulated
    assert given is not None
    assert designed is not None
    assert designed.median_error < given.median_error
    excitation = improved.found.excitation
    assert excitation.amplitude <= 5e-3
    assert excitation.frequency_hz is not None
    assert 2.0 < excitation.frequency_hz <= 15.0
    assert excitation.duration == SHORT


@pytest.mark.evidence
def test_a_good_excitation_stays() -> None:
    # The thesis's chirp reaches all its own limits: a smaller amplitude or frequency cannot be better.
    result = design(THESIS, Chirp(duration=0.2), duration=0.2, candidates=2, tests=4, workers=1)
    assert result.found is result.given
    assert not result.better
    assert "Nothing better was found" in str(result)


def test_the_finalist_with_the_narrower_intervals_in_simulated_tests_is_selected(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    predicted = Precision({}, np.zeros(4))
    finalists = [PlannedTest(Excitation(Chirp(stop_hz=hertz), 0.5), predicted) for hertz in (9.0, 12.0)]
    calls = []

    def simulated(_: TestSetup, excitations: list[Excitation], *given: Any) -> list[SimulatedTests]:
        calls.append((excitations, given[:2]))
        wide, narrow = (Precision({}, np.full(4, width)) for width in (-3.0, -4.0))
        return [SimulatedTests(candidate, np.ones(4), np.zeros(4)) for candidate in (wide, narrow)]

    monkeypatch.setattr(candidate_search, "simulate_tests", simulated)
    setup = TestSetup.of(THESIS, ("current",), 0.05, 5000.0)
    assert choose_finalist(setup, finalists, 12, 3, None) is finalists[1]
    assert calls == [([finalist.excitation for finalist in finalists], (6, 3))]
    assert choose_finalist(setup, finalists[:1], 12, 3, None) is finalists[0]
    assert len(calls) == 1


def test_simulated_tests_that_contradict_the_prediction_do_not_confirm_it(improved: Design) -> None:
    assert improved.given.simulated is not None
    simulated = improved.given.simulated.precision
    given = replace(improved.given, predicted=simulated)
    right = replace(improved, given=given, found=given, gain=None)
    assert any(line.startswith("Confirmed by diagnoses of 4 tests") for line in right.notes())
    narrow = replace(simulated, half_widths={k: width / 3 for k, width in simulated.half_widths.items()})
    given = replace(given, predicted=narrow)
    notes = replace(right, given=given, found=given).notes()
    assert any(line.startswith("Tested by diagnoses of 4 tests") for line in notes)
    assert any(line.startswith("Not confirmed: friction, ") for line in notes)


@pytest.mark.parametrize(("channels", "seen"), [(("current",), False), (("current", "position"), True)])
def test_a_constant_command_has_a_note_unless_the_position_is_recorded(
    channels: tuple[str, ...], seen: bool
) -> None:
    result = design(EMPS, Step(0.1), duration=0.1, channels=channels, candidates=0, tests=0, workers=1)
    assert any("detects no motion" in line for line in result.notes()) != seen


def test_a_difference_by_chance_is_seldom_significant() -> None:
    rng = np.random.default_rng(0)
    tests, runs = 12, 4000

    def proven(logarithms: Any) -> SimulatedTests:
        return SimulatedTests(Precision({}, logarithms), np.ones(tests), np.zeros(tests))

    real = [Gain.of(*(proven(rng.normal(-4, 0.3, tests)) for _ in "ab")).significant for _ in range(runs)]
    rate = scipy.stats.t.sf(2.0, tests - 1)
    # Four standard errors of a rate over this number of runs.
    assert np.mean(real) == pytest.approx(rate, abs=4 * (rate / runs) ** 0.5)


def test_narrower_intervals_with_larger_errors_are_no_gain() -> None:
    widths = np.linspace(-4.2, -3.8, 12)
    given = SimulatedTests(Precision({}, widths), np.ones(12), np.full(12, -6.0))
    narrower = replace(given, precision=Precision({}, widths - 0.2))
    assert Gain.of(given, narrower).significant
    assert not Gain.of(given, replace(narrower, logarithms=np.linspace(-5.9, -5.5, 12))).significant
    assert Gain.of(given, narrower).narrower == pytest.approx(0.2)


def test_without_windings_the_fitted_model_simulates_the_tests_and_a_note_states_it(linear: Design) -> None:
    assert linear.to_dict()["proven_by"] == "averaged"
    assert "of kind 'current' does not switch" in str(linear)
    assert set(linear.given.predicted.half_widths) == {"friction", "gain"}
    assert str(linear).count("not in this actuator") >= 6  # the other components
    proven = linear.given.simulated
    assert proven is not None
    for name, half in linear.given.predicted.half_widths.items():
        assert 0.5 < proven.precision.half_widths[name] / half < 2


def test_the_same_seed_has_the_same_result(linear: Design) -> None:
    repeated = linear_design(workers=2)
    assert repeated.to_dict() == linear.to_dict()


def test_without_a_search_the_given_manoeuvre_is_reported() -> None:
    result = design(EMPS, Step(), candidates=0, tests=0)
    assert not result.better
    assert (result.gain, result.given.simulated) == (None, None)
    assert result.given.predicted.identifies("gain")
    assert "No better manoeuvre was searched for." in str(result)
    assert "Not confirmed" in str(result)


def test_a_design_is_written_as_plain_json_and_text(improved: Design) -> None:
    values = json.loads(json.dumps(improved.to_dict(), allow_nan=False))
    assert values["better"] is True
    assert values["found"]["manoeuvre"]["stop_hz"] <= 15.0
    assert set(values["given"]["expected"]) == set(values["found"]["proven"]) == set(NAMES)
    text = str(improved)
    for piece in (*NAMES, "given, simulated", "found, predicted", "reference model", "intervals narrower by"):
        assert piece in text


def test_the_designed_command_is_written_completely(improved: Design, tmp_path: Path) -> None:
    improved.write_command(tmp_path / "found.csv")
    signal = read_signal(str(tmp_path / "found.csv"), "command_rad")
    excitation = improved.found.excitation
    t = np.linspace(0.0, SHORT, 5000)
    # Straight lines between 200 rows a period: (2 pi / 200)² / 8 of the amplitude.
    np.testing.assert_allclose(signal(t), excitation.command(t), atol=1.3e-4 * excitation.amplitude)
    assert signal.time_s[-1] == pytest.approx(SHORT)


def test_a_command_from_a_file_is_written_unchanged(tmp_path: Path) -> None:
    # At 10 kHz, with 60 Hz at its end, which rows at 100 Hz would not resolve.
    t = np.arange(-100, 6001) * 1e-4
    given = Sampled(t, 5e-3 * np.sin(2 * np.pi * 60 * t * t))
    Excitation(given, 0.5).write(tmp_path / "given.csv", 100.0)
    written = read_signal(str(tmp_path / "given.csv"), "command_rad")
    between = np.linspace(0.0, 0.5, 33_333)
    np.testing.assert_allclose(written(between), given(between), atol=1e-12)
    assert (written.time_s[0], written.time_s[-1]) == (0.0, 0.5)


@pytest.mark.parametrize("start", [0.0, 0.105, 0.1, 0.5, 0.7])
def test_a_written_step_rises_at_its_start(start: float, tmp_path: Path) -> None:
    step = Step(5e-3, start)
    Excitation(step, 0.5).write(tmp_path / "step.csv", 100.0)
    written = read_signal(str(tmp_path / "step.csv"), "command_rad")
    times = np.array([0.0, start - 1e-6, start, start + 1e-6, 0.5])
    times = times[(times >= 0) & (times <= 0.5)]
    np.testing.assert_array_equal(written(times), step(times))


def test_the_range_of_a_command_from_a_file_includes_a_short_pulse() -> None:
    pulse = Sampled([0.0, 30.0, 30.001, 30.002, 70.0], [0.0, 0.0, 0.7, 0.0, -0.9])
    assert Excitation(pulse, 60.0).range == pytest.approx((-0.9 * 29.998 / 39.998, 0.7))


def test_a_command_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="cannot be written"):
        THESIS_CHIRP.write(tmp_path / "absent" / "command.csv", 100.0)


def test_the_figure_shows_both_manoeuvres_and_all_half_widths(improved: Design, linear: Design) -> None:
    commands, widths = improved.plot().axes
    assert (commands.get_xlabel(), commands.get_ylabel()) == ("time [s]", "command [rad]")
    assert "half-width" in widths.get_xlabel()
    legends = [legend for axis in (commands, widths) if (legend := axis.get_legend())]
    texts = [text.get_text() for legend in legends for text in legend.get_texts()]
    for label in ("given: chirp", "found: chirp", "given, predicted", "found, simulated"):
        assert any(text.startswith(label) for text in texts)
    drawn = {line.get_label(): np.asarray(line.get_xdata()) for line in widths.get_lines()}
    np.testing.assert_array_equal(
        drawn["found, predicted"], [improved.found.predicted.half_widths[name] for name in NAMES]
    )
    rows = [tick.get_text() for tick in widths.get_yticklabels()]
    assert rows == list(NAMES)
    assert linear.plot().axes[0].get_ylabel() == "command [m]"


@pytest.mark.parametrize(
    "channels", [("current", "speed"), ("speed_rad_s", "current_A"), ("speed", "current_A")]
)
def test_channels_are_given_by_short_names_or_column_names(channels: tuple[str, ...]) -> None:
    assert TestSetup.of(EMPS, channels, 0.05, 5000.0).channels == ("current_A", "speed_rad_s")


BAD: dict[str, tuple[Callable[[], Any], str]] = {
    "channel": (lambda: design(THESIS, channels=("current", "volt")), "did you mean 'voltage'"),
    "no current": (lambda: design(THESIS, channels=("voltage",)), "put current among the channels"),
    "no windings": (lambda: design(EMPS, channels=("current", "voltage")), "[electrical]"),
    "noise": (lambda: design(THESIS, noise=0.0), "noise of 0 A"),
    "noise nan": (lambda: design(THESIS, noise=float("nan")), "noise of nan A"),
    "rate": (lambda: design(THESIS, sample_rate=-1.0), "sample rate of -1 Hz"),
    "seed": (lambda: design(THESIS, seed=-1), "seed -1 is negative"),
    "candidates": (lambda: design(THESIS, candidates=-1), "-1 candidates"),
    "few tests": (lambda: design(THESIS, tests=2), "too few simulated tests"),
    "unproven": (lambda: design(THESIS, tests=0), "not proven to be better"),
    "duration": (lambda: design(THESIS, duration=61.0), "give up to 60 s"),
    "no duration": (lambda: design(THESIS, duration=0.0), "give up to 60 s"),
    "few rows": (lambda: design(THESIS, duration=1e-3), "are 5 rows"),
    "amplitude": (lambda: design(THESIS, max_amplitude=-1.0), "largest amplitude of -1"),
    "frequency nan": (lambda: design(THESIS, max_frequency=float("nan")), "largest frequency of nan"),
    "exceeded": (lambda: design(THESIS, max_frequency=5.0), "15 is more than 5"),
    "end stops": (lambda: design(THESIS, max_amplitude=1e3), "beyond the end stops"),
    "too fast": (lambda: design(THESIS, max_frequency=2600.0), "cannot be recorded at 5000 Hz"),
    "too long": (lambda: design(THESIS, max_duration=61.0), "too long"),
    "a step": (lambda: design(THESIS, Step()), "no highest frequency of its own"),
    "no command": (lambda: design(THESIS, Sine(0.0, 4.0), max_amplitude=1e-3), "does not move the actuator"),
    "no motion": (lambda: design(THESIS, Sine(1e-9, 4.0)), "does not move the actuator"),
}


LIMITS: dict[str, tuple[dict[str, Any], str]] = {
    "amplitude": ({"max_amplitude": 1e-3}, "0.005 is more than 0.001"),
    "frequency": ({"max_frequency": 5.0}, "15 is more than 5"),
    "duration": ({"max_duration": 0.1}, "0.5 is more than 0.1"),
    "no limit": ({"max_amplitude": -1.0}, "largest amplitude of -1"),
    "rate": ({"command": Sine(5e-3, 90.0), "sample_rate": 150.0}, "cannot be recorded at 150 Hz"),
    "end stops": ({"command": Step(0.6)}, "beyond the end stops"),
}


@pytest.mark.parametrize("candidates", [0, 4])
@pytest.mark.parametrize(("given", "message"), LIMITS.values(), ids=LIMITS.keys())
def test_the_given_excitation_keeps_the_limits_with_and_without_a_search(
    given: dict[str, Any], message: str, candidates: int
) -> None:
    # A step has no highest frequency of its own, which a search needs.
    more: dict[str, Any] = {"max_frequency": 10.0} if isinstance(given.get("command"), Step) else {}
    with pytest.raises(EmaphmError, match=message):
        design(THESIS, candidates=candidates, tests=4, **more, **given)


def test_a_given_excitation_may_use_the_longer_side_of_its_end_stops() -> None:
    stops = {"mechanics": EMPS.mechanics.model_copy(update={"end_stops": (-1e-3, 0.1)})}
    one_sided = EMPS.model_copy(update=stops)
    assert not design(one_sided, Step(5e-3), candidates=0, tests=0).better
    with pytest.raises(EmaphmError, match=r"0\.005 is beyond the end stops"):
        design(one_sided, Step(-5e-3), candidates=0, tests=0)


def test_a_test_of_a_retracted_actuator_is_planned_in_the_middle_of_its_travel(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # The plans are compared by their predictions; simulated tests of plans are compared with them above.
    module = importlib.import_module("emaphm.experiment.design")  # a function has its name
    equal = SimulatedTests(Precision({}, np.full(4, -3.0)), np.ones(4), np.zeros(4))
    monkeypatch.setattr(module, "simulate_tests", lambda _, excitations, *__: [equal] * len(excitations))
    # Whole turns of the motor away, so that the electrical angle is the same as at 0.
    middle = 20 * 2 * np.pi * THESIS.mechanics.gear_ratio
    stops = THESIS.mechanics.model_copy(update={"end_stops": (0.0, 2 * middle)})
    retracted = THESIS.model_copy(update={"mechanics": stops})
    result = design(retracted, duration=SHORT, candidates=1, tests=4, max_amplitude=0.02)
    for mine in (result.given, result.found):
        assert mine.excitation.rests_at == middle
        command = mine.excitation.command
        assert isinstance(command, Chirp | DecayingChirp)
        expected = design(THESIS, replace(command, about=0.0), duration=SHORT, candidates=0, tests=0).given
        assert mine.predicted.half_widths == pytest.approx(expected.predicted.half_widths, rel=0.05)
    # The complete travel, which rounding must not refuse, and a command about another position.
    assert design(retracted, Sine(middle, 2.0, middle), candidates=0, tests=0, duration=1.0)
    apart = design(THESIS, Chirp(about=0.1), initial_position=0.102, candidates=0, tests=0).given.excitation
    assert apart.amplitude == pytest.approx(7e-3)
    assert (
        apart.words("rotary") == "chirp of 0.005 rad, 0 to 15 Hz about 0.1 rad, 0.5 s, from rest at 0.102 rad"
    )
    assert apart.to_dict().items() >= {"about": 0.1, "initial_position": 0.102}.items()
    with pytest.raises(EmaphmError, match=r"give 0\.251327 or less$"):
        design(retracted, candidates=4, tests=4, max_amplitude=0.3)
    with pytest.raises(EmaphmError, match=r"give 0\.1 or less, or start in the middle \(--about 0\.251327\)"):
        design(retracted, Chirp(0.2, about=0.1), candidates=0, tests=0)


@pytest.mark.parametrize(("call", "message"), BAD.values(), ids=BAD.keys())
def test_impossible_arguments_are_refused_in_one_line(call: Callable[[], Any], message: str) -> None:
    with pytest.raises(EmaphmError) as error:
        call()
    assert message in str(error.value)
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize("duration", [1.0, 2.0])
def test_the_default_chirp_sweeps_to_15_hz_whatever_its_duration(duration: float) -> None:
    result = design(EMPS, duration=duration, candidates=0, tests=0)
    t = np.linspace(0.0, duration, 200_001)
    crossings = t[1:][np.diff(np.sign(result.given.excitation.command(t))) != 0]
    # The last two crossings are less than a period before the end; in a period, it sweeps by 1 Hz at most.
    assert 0.5 / (crossings[-1] - crossings[-2]) == pytest.approx(15.0, abs=1.0)
    assert result.given.excitation.frequency_hz == 15.0


def test_a_chirp_beyond_its_own_duration_continues_its_sweep_and_exceeds_its_limit() -> None:
    chirp = Chirp(2e-3, 0.0, 15.0, 0.5)
    longer = Excitation(chirp, 2.0)
    t = np.linspace(0.0, 2.0, 400_001)
    crossings = t[1:][np.diff(np.sign(chirp(t))) != 0]
    reached = 0.5 / (crossings[-1] - crossings[-2])
    assert longer.frequency_hz == pytest.approx(reached, rel=0.02)
    assert "to 60 Hz" in longer.words("rotary")
    assert Excitation(DecayingChirp(), 2.0).frequency_hz == 15.0  # zero after half a second
    with pytest.raises(EmaphmError, match="60 is more than 15"):
        design(THESIS, chirp, duration=2.0, max_frequency=15.0)


@pytest.mark.parametrize(
    ("command", "amplitude", "frequency"),
    [
        (Chirp(-2e-3, 9.0, 3.0), 2e-3, 9.0),
        (Sine(1e-3, 6.0), 1e-3, 6.0),
        (Step(3e-3), 3e-3, None),
        (lambda t: 2e-3 * np.sin(40 * t), 2e-3, None),
    ],
)
def test_the_limits_of_a_manoeuvre(command: Command, amplitude: float, frequency: float | None) -> None:
    manoeuvre = Excitation(command, 0.5)
    assert manoeuvre.amplitude == pytest.approx(amplitude, rel=1e-5)
    assert manoeuvre.frequency_hz == frequency
    assert json.loads(json.dumps(manoeuvre.to_dict()))["duration_s"] == 0.5
