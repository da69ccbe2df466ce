"""A diagnosis with an estimator: the answer is accepted, corrected or rejected, or the recording refused."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from amortized.toys import THESIS, constant_estimator, with_limit
from emaphm.actuator import Actuator, Chirp, Faults, Ramp
from emaphm.amortized import diagnosing
from emaphm.amortized.diagnosing import answer_alone, diagnose_by
from emaphm.amortized.estimator import Estimator
from emaphm.amortized.networks.mixture import Mixture
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.arrays import Array
from emaphm.diagnosis import Diagnosis, diagnose, error_percent
from emaphm.diagnosis.explanation.one_way import REASON as ONE_WAY
from emaphm.errors import MethodError
from emaphm.estimation.starts import Starts
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

pytestmark = pytest.mark.usefixtures("any_delay_shows")

TRUTH = Faults(friction=0.4, backlash=0.3, short_b=0.2, eccentricity=0.3, eccentricity_phase=0.7, gain=0.6)
COMMAND = Chirp(duration=0.2)
SETUP = RecordingSetup.of(THESIS, COMMAND, duration=0.2)
ANSWER = SETUP.space.points(TRUTH.vector)


@pytest.fixture(scope="module")
def recording() -> Recording:
    whole = simulate(THESIS, COMMAND, duration=0.2, faults=TRUTH, noise=0.05, adc_bits=12)
    return Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")})


def test_the_answer_alone_is_the_networks(recording: Recording) -> None:
    diagnosis = diagnose_by(constant_estimator(SETUP, ANSWER, 0.01), recording, THESIS, fast=True)
    assert diagnosis.method == "estimator"
    assert diagnosis.explained
    # The difference is the half precision of the weights.
    np.testing.assert_allclose(diagnosis.faults.vector, TRUTH.vector, atol=1e-3)
    assert diagnosis.components["friction"].standard_error == pytest.approx(0.01, rel=1e-3)
    assert diagnosis.components["friction"].verdict == "degraded"
    values = diagnosis.to_dict()
    assert values.keys() >= diagnose(recording, THESIS, max_corrections=0).to_dict().keys()
    low, high = values["posterior"]["faults"]["gain"]["interval95"]
    assert 0.6 - 0.024 < low < 0.6 - 0.016 < 0.6 + 0.016 < high < 0.6 + 0.024


def test_the_answer_alone_names_no_friction_where_the_manoeuvre_goes_one_way() -> None:
    ramp, truth = Ramp(0.1), Faults(friction=0.4, short_b=0.2)
    setup = RecordingSetup.of(THESIS, ramp, duration=0.25)
    whole = simulate(THESIS, ramp, duration=0.25, faults=truth, noise=0.05, adc_bits=12)
    recording = Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")})
    sure = constant_estimator(setup, setup.space.points(truth.vector), 0.01)
    found = diagnose_by(sure, recording, THESIS, fast=True)
    assert found.method == "estimator"
    assert found.components["short_b"].verdict == "degraded"
    assert found.components["friction"].verdict == "cannot tell"
    assert found.components["friction"].reason == ONE_WAY


@pytest.mark.usefixtures("answers_taken")
def test_the_answer_alone_has_the_cautions_of_any_diagnosis() -> None:
    setup = RecordingSetup.of(THESIS, COMMAND, duration=0.2, channels=("current_A",))
    whole = simulate(THESIS, COMMAND, duration=0.2, faults=TRUTH, noise=0.05)
    recording = Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A")})
    answer = constant_estimator(setup, setup.space.points(TRUTH.vector), 0.01)
    found = diagnose_by(answer, recording, THESIS, fast=True)
    assert found.method == "estimator"
    assert any("the inertia is taken as described" in note for note in found.recording_notes)


def test_an_estimator_of_another_start_position_accepts_recordings_that_start_there(
    recording: Recording, tmp_path: Path
) -> None:
    # Whole turns of the motor out, so that the phases are where they are at 0.
    about = 2 * np.pi * THESIS.mechanics.gear_ratio
    setup = RecordingSetup.of(THESIS, Chirp(duration=0.2, about=about), duration=0.2)
    path = tmp_path / "there.estimator"
    constant_estimator(setup, ANSWER, 0.01).save(path)
    there = Estimator.load(path)
    moved = {name: recording[name] + (about if name == "command_rad" else 0.0) for name in recording}
    assert diagnose_by(there, Recording(moved), THESIS, fast=True).method == "estimator"
    with pytest.raises(MethodError, match="another manoeuvre"):
        diagnose_by(there, recording, THESIS, fast=True)
    shifted = Recording(moved | {"position_rad": recording["command_rad"]})
    reasons = answer_alone(there, shifted, THESIS)
    assert isinstance(reasons, tuple)
    assert "starts at rest at 0.0125664" in reasons[0]


def test_a_start_after_a_motion_is_not_that_of_the_training() -> None:
    assert SETUP.starts_there(SETUP.start)
    assert not SETUP.starts_there(replace(SETUP.start, gap=1.0))


def test_the_answer_alone_is_had_without_a_search(recording: Recording) -> None:
    sure = constant_estimator(SETUP, ANSWER, 0.01)
    found = answer_alone(sure, recording, THESIS)
    assert isinstance(found, Diagnosis)
    assert found.faults == diagnose_by(sure, recording, THESIS, fast=True).faults
    for unusable, why in (
        (with_limit(sure, 1e-6), "larger than that of simulations"),
        (constant_estimator(SETUP, ANSWER + 0.05, 0.05), "residual"),
    ):
        reasons = answer_alone(unusable, recording, THESIS)
        assert isinstance(reasons, tuple)
        assert any(why in reason for reason in reasons)


def test_a_delay_is_named_only_where_the_answer_explains_the_rest(
    recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(diagnosing, "delay_clause", lambda *_: "current_A seems to come a row late")
    sure, hardly_trained = (
        constant_estimator(SETUP, answer, 0.01)
        for answer in (ANSWER, SETUP.space.points(Faults(gain=0.9).vector))
    )
    assert answer_alone(sure, recording, THESIS) == ("current_A seems to come a row late",)
    reasons = answer_alone(hardly_trained, recording, THESIS)
    assert isinstance(reasons, tuple)
    assert reasons[0].startswith("current_A: the residual of ")
    assert not any("late" in reason for reason in reasons)


def test_a_search_begins_at_the_answer(recording: Recording) -> None:
    near = ANSWER + 0.02
    # With named nuisances, no selection follows the search.
    named = THESIS.nuisances.estimated
    diagnosis = diagnose_by(
        constant_estimator(SETUP, near, 0.03), recording, THESIS, nuisances=named, workers=1
    )
    assert diagnosis.method == "estimator+lsq"
    assert error_percent(TRUTH.vector, diagnosis.faults.vector) < 1.5
    full = diagnose(recording, THESIS, nuisances=named, workers=1)
    assert diagnosis.evaluations < 0.8 * full.evaluations
    uncorrected = diagnose_by(
        constant_estimator(SETUP, near, 0.03), recording, THESIS, max_corrections=0, workers=1
    )
    assert uncorrected.reference_runs < diagnosis.reference_runs


def test_an_answer_that_explains_nothing_is_corrected(recording: Recording) -> None:
    off = constant_estimator(SETUP, ANSWER + 0.05, 0.05)
    diagnosis = diagnose_by(off, recording, THESIS, fast=True, max_corrections=0, workers=1)
    assert diagnosis.method == "estimator+lsq"
    assert any("answer was corrected" in note for note in diagnosis.recording_notes)


def test_a_recording_unlike_the_training_set_is_searched_in_full(recording: Recording) -> None:
    estimator = with_limit(constant_estimator(SETUP, ANSWER, 0.01), 1e-6)
    # With named nuisances, no selection follows the search.
    named = THESIS.nuisances.estimated
    diagnosis = diagnose_by(estimator, recording, THESIS, fast=True, nuisances=named, workers=1)
    assert diagnosis.method == "hybrid"
    assert any("is not accepted" in note for note in diagnosis.recording_notes)
    assert error_percent(TRUTH.vector, diagnosis.faults.vector) < 1.5


def test_a_search_begins_at_the_answer_for_a_rare_recording(recording: Recording) -> None:
    near, named = constant_estimator(SETUP, ANSWER + 0.01, 0.02), THESIS.nuisances.estimated
    rare = replace(near, limits=replace(near.limits, distances=np.zeros(2)))
    for fast in (False, True):
        diagnosis = diagnose_by(rare, recording, THESIS, nuisances=named, fast=fast, workers=1)
        assert diagnosis.method == "estimator+lsq"
        assert error_percent(TRUTH.vector, diagnosis.faults.vector) < 1.5
        noted = any("middle of the training set" in note for note in diagnosis.recording_notes)
        assert noted == fast


def test_a_recording_of_a_frozen_sensor_is_searched_in_full(recording: Recording) -> None:
    voltage = recording["voltage_V"].copy()
    voltage[600:800] = voltage[600]
    sure, frozen = constant_estimator(SETUP, ANSWER, 0.01), chirp(recording, voltage_V=voltage)
    diagnosis = diagnose_by(sure, frozen, THESIS, fast=True, max_corrections=0)
    assert diagnosis.method == "hybrid"
    assert any("is not accepted: voltage_V" in note for note in diagnosis.recording_notes)


def test_a_wrong_answer_with_a_small_uncertainty_is_not_accepted(recording: Recording) -> None:
    wrong = constant_estimator(SETUP, SETUP.space.points(Faults(friction=0.9).vector), 1e-3, limit=3.0)
    wrong = replace(wrong, limits=replace(wrong.limits, distances=np.full(2, np.inf)))
    diagnosis = diagnose_by(wrong, recording, THESIS, fast=True, max_corrections=0, workers=1)
    assert diagnosis.method == "hybrid"
    assert any("answer's own uncertainty" in note for note in diagnosis.recording_notes)


def test_an_answer_of_a_large_predicted_error_is_not_accepted(recording: Recording) -> None:
    estimator = constant_estimator(SETUP, ANSWER, 0.01)
    estimator = replace(estimator, limits=replace(estimator.limits, predicted_error=0.4))
    diagnosis = diagnose_by(estimator, recording, THESIS, fast=True, max_corrections=0, workers=1)
    assert diagnosis.method == "hybrid"
    assert any(
        "predicted error 0.5 of the allowed one, at most 0.4" in note for note in diagnosis.recording_notes
    )


def test_a_search_that_leads_away_from_a_sure_answer_is_made_anew(recording: Recording) -> None:
    off = constant_estimator(SETUP, ANSWER + 0.03, 0.005)
    diagnosis = diagnose_by(off, recording, THESIS, nuisances=THESIS.nuisances.estimated, workers=1)
    assert diagnosis.method == "hybrid"
    assert any("away from the estimator's answer" in note for note in diagnosis.recording_notes)
    assert error_percent(TRUTH.vector, diagnosis.faults.vector) < 1.5


def test_laws_that_a_search_from_an_answer_finds_are_searched_for_in_full(
    recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    estimator = constant_estimator(SETUP, ANSWER, 0.01)
    found = diagnose_by(estimator, recording, THESIS, max_corrections=0, workers=1)
    searched = []

    def with_a_law(recording: Recording, *_: object, starts: Starts | None, **__: object) -> Diagnosis:
        searched.append((starts is None, recording.notes))
        return found if starts is None else replace(found, laws=("cogging",))

    monkeypatch.setattr(diagnosing, "diagnose", with_a_law)
    assert diagnose_by(estimator, recording, THESIS, workers=1).laws == ()
    assert [in_full for in_full, _ in searched] == [False, True]
    assert "answer found laws: cogging; all of the range was searched" in searched[1][1][-1]


def test_a_search_begins_at_several_points_where_the_answer_is_wide() -> None:
    def starts(deviation: float, shorts: float = 0.0) -> int:
        middle = np.where(np.isin(SETUP.space.columns, (2, 3, 4)), shorts, 0.3)
        mean = np.concatenate([middle, np.zeros(SETUP.space.dimensions - middle.size)])
        one = Mixture(np.ones(1), mean[np.newaxis], deviation * np.eye(mean.size)[np.newaxis])
        return len(diagnosing._starts(one, SETUP.space, 0).points)

    assert starts(0.01) == 1
    assert starts(0.1) == starts(0.01, shorts=0.6) == 1 + diagnosing.DRAWS


def chirp(recording: Recording, **columns: Array) -> Recording:
    return Recording({**recording.channels, **columns})


def without(recording: Recording, name: str) -> Recording:
    return Recording({key: values for key, values in recording.channels.items() if key != name})


def at_instants(actuator: Actuator) -> Actuator:
    channels = actuator.channels.model_copy(update={"sampling": "instant"})
    return actuator.model_copy(update={"channels": channels})


OTHERWISE: dict[str, tuple[Callable[[Recording], Recording], Callable[[], RecordingSetup], str]] = {
    "another actuator": (
        lambda r: r,
        lambda: RecordingSetup.of(Actuator.pmsm(), COMMAND, duration=0.2),
        "another description",
    ),
    "a missing channel": (
        partial(without, name="voltage_V"),
        lambda: RecordingSetup.of(THESIS, COMMAND, duration=0.2, channels=["current_A"]),
        "no voltage_V",
    ),
    "another manoeuvre": (
        lambda r: chirp(r, command_rad=0.9 * r["command_rad"]),
        lambda: RecordingSetup.of(THESIS, lambda t: 0.9 * np.asarray(COMMAND(t)), duration=0.2),
        "another manoeuvre",
    ),
    "another rate": (
        lambda r: Recording({name: values[::2] for name, values in r.channels.items()}),
        lambda: RecordingSetup.of(THESIS, COMMAND, duration=0.2, sample_rate=2500.0),
        "rows a second",
    ),
    "another duration": (
        lambda r: Recording({name: values[:800] for name, values in r.channels.items()}),
        lambda: RecordingSetup.of(THESIS, COMMAND, duration=0.16),
        "800 rows",
    ),
    "instants": (
        lambda r: Recording(r.channels, "instant"),
        lambda: RecordingSetup.of(at_instants(THESIS), COMMAND, duration=0.2),
        "instants",
    ),
}
"""Changes of a recording, and the setup of an estimator that would be trained for it."""


@pytest.mark.parametrize("case", OTHERWISE)
def test_a_recording_for_another_estimator_is_refused_with_both_remedies(
    recording: Recording, case: str
) -> None:
    change, trained_for_it, complaint = OTHERWISE[case]
    changed, setup = change(recording), trained_for_it()
    actuator = setup.actuator if case == "another actuator" else THESIS
    with pytest.raises(MethodError, match=complaint) as error:
        diagnose_by(constant_estimator(SETUP, ANSWER, 0.01), changed, actuator, fast=True)
    assert "leave out --estimator, or train one" in str(error.value)
    constant_estimator(setup, np.zeros(setup.space.dimensions), 0.01).check(changed, setup.actuator)


NEVER: dict[str, tuple[Callable[[Recording], Recording], Actuator, str]] = {
    "no three phases": (lambda r: r, Actuator.dc(), "no estimator is trained for"),
    "no current": (partial(without, name="current_A"), THESIS, "no current_A"),
    "a known load": (lambda r: chirp(r, load_Nm=np.full(r.samples, 0.1)), THESIS, "known load"),
    "a known load at another rate": (
        lambda r: chirp(r, time_s=2 * r["time_s"], load_Nm=np.full(r.samples, 0.1)),
        THESIS,
        "known load",
    ),
    "a drive switched off": (
        lambda r: chirp(r, enabled=(np.arange(r.samples) > 100).astype(float)),
        THESIS,
        "switched off",
    ),
    "too many rows": (lambda r: longer(r, 20_001), THESIS, "20,001 rows"),
}
"""Recordings for which no estimator can be trained: no message advises to train one."""


def longer(recording: Recording, rows: int) -> Recording:
    columns = {name: np.resize(values, rows) for name, values in recording.channels.items()}
    return Recording({**columns, "time_s": np.arange(rows) * recording.interval_s})


@pytest.mark.parametrize("case", NEVER)
def test_a_recording_for_no_estimator_is_refused_with_one_remedy(recording: Recording, case: str) -> None:
    change, actuator, complaint = NEVER[case]
    with pytest.raises(MethodError, match=complaint) as error:
        diagnose_by(constant_estimator(SETUP, ANSWER, 0.01), change(recording), actuator, fast=True)
    assert str(error.value).endswith("leave out --estimator")


def test_another_name_or_other_columns_are_the_same_actuator(recording: Recording) -> None:
    renamed = THESIS.model_copy(update={"name": "unit 7"})
    estimator = constant_estimator(SETUP, ANSWER, 0.01)
    assert diagnose_by(estimator, recording, renamed, fast=True).method == "estimator"


def test_an_actuator_without_windings_is_refused() -> None:
    ideal = Actuator.from_dict(
        THESIS.model_dump(mode="json", exclude_none=True, exclude={"electrical"}), where="ideal"
    )
    with pytest.raises(MethodError, match="windings"):
        RecordingSetup.of(ideal, Chirp())


@pytest.mark.parametrize(
    "channels", [("voltage", "current"), ("voltage_V", "current"), ("current_A", "voltage")]
)
def test_channels_of_a_setup_go_by_short_names_or_by_their_columns(channels: tuple[str, ...]) -> None:
    setup = RecordingSetup.of(THESIS, COMMAND, duration=0.2, channels=channels)
    assert setup.channels == ("current_A", "voltage_V")


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"channels": ("voltage_V",)}, "current_A"),
        ({"channels": ("current_A", "sped")}, "speed_rad_s"),
        ({"duration": 100.0}, "rows"),
        ({"noise": -1.0}, "rms"),
        ({"command": Chirp(amplitude=1.0)}, "beyond the end stops"),
    ],
)
def test_impossible_setups_are_refused(values: dict[str, object], complaint: str) -> None:
    with pytest.raises(MethodError, match=complaint):
        RecordingSetup.of(**{"actuator": THESIS, "command": Chirp()} | values)  # type: ignore[arg-type]
