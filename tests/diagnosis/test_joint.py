"""Joint diagnosis of several recordings of a unit: smaller errors, and detection of contradictions."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cases import THESIS, USUAL, covered, on_a_rig
from emaphm.actuator import NAMES, Actuator, Chirp, Faults, Load
from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.cli import main
from emaphm.diagnosis import diagnose
from emaphm.diagnosis.joint import JointDiagnosis, diagnose_joint
from emaphm.diagnosis.joint.alone import with_better_fits
from emaphm.diagnosis.joint.result import JointRecording, on_contradictions
from emaphm.diagnosis.selection import first_look
from emaphm.diagnosis.selection.laws import hidden_laws, sensor_lag
from emaphm.errors import MethodError
from emaphm.estimation.global_search.multistart import MULTISTART
from emaphm.estimation.joint.contradictions import dissenting
from emaphm.estimation.joint.objective import JointObjective, RecordingTerm
from emaphm.estimation.joint.random_effects import random_effects
from emaphm.estimation.joint.uncertainty import AloneEstimates
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.recording import Recording, acquire, write_recording
from emaphm.simulated_recording import simulate
from emaphm.simulation import AVERAGED

pytestmark = pytest.mark.usefixtures("one_search", "unrefined")

CHANNELS = ("time_s", "command_rad", "current_A", "position_rad")
NOISE = {"current_A": 0.3, "position_rad": 5e-5}
IDEAL = Actuator.from_dict(
    THESIS.model_dump()
    | {"electrical": None, "nuisances": THESIS.nuisances.model_dump(exclude_none=True) | {"delay": 1e-6}}
)
"""With an ideal current loop, the reference model has no ripple. The channels are synchronous, so that
no delay is confounded with a gain."""

FAULTS = Faults(friction=0.3, backlash=0.4, gain=0.4)


def recorded(
    faults: Faults,
    seed: int,
    *,
    actuator: Actuator = IDEAL,
    stop_hz: float = 15.0,
    duration: float = 0.15,
    channels: tuple[str, ...] = CHANNELS,
) -> Recording:
    """Return a recording of the reference model, of which only the noise is unexplained."""
    whole = simulate(
        actuator,
        Chirp(stop_hz=stop_hz, duration=duration),
        faults=faults,
        sampling="instant",
        sample_rate=1 / AVERAGED.step,
        duration=duration,
    )
    kept = Recording({name: whole[name] for name in channels}, "instant", f"day {seed}")
    return acquire(kept, noise={name: NOISE[name] for name in channels if name in NOISE}, seed=seed)


def joint(recordings: list[Recording], **options: Any) -> JointDiagnosis:
    return diagnose_joint(recordings, IDEAL, nuisances=("load",), **options)


def errors(diagnosis: JointDiagnosis) -> np.ndarray:
    """Return the standard errors of the coordinates, without regard to their bounds."""
    return np.asarray(np.sqrt(np.diag(diagnosis.covariance)))


def test_a_delay_confounded_with_the_gain_leaves_it_undecided() -> None:
    whole = simulate(THESIS, Chirp(duration=0.2), duration=0.2, noise=0.05, adc_bits=12)
    late = np.clip(np.arange(whole.samples) - 1, 0, None)
    day = Recording(
        {"time_s": whole["time_s"], "command_rad": whole["command_rad"]}
        | {name: whole[name][late] for name in ("current_A", "voltage_V")}
    )
    gain = diagnose_joint([day], THESIS, nuisances=USUAL).components["gain"]
    assert gain.verdict == "cannot tell"
    assert "0.2 ms late" in gain.reason


def test_the_residual_is_that_of_the_compared_rows() -> None:
    day = recorded(FAULTS, 2)
    columns = {name: np.array(day[name]) for name in CHANNELS}
    columns["current_A"][1500:3000] = columns["current_A"][1500]
    diagnosis = joint([Recording(columns, "instant", "day 2")])
    (recording,) = diagnosis.recordings
    assert recording.misfit_ratio == pytest.approx(1.0, abs=0.02)
    assert diagnosis.residual_rms_A == pytest.approx(recording.residual_rms_A)


def test_the_joint_diagnosis_of_one_recording_is_its_diagnosis() -> None:
    day = recorded(FAULTS, 1)
    together = joint([day])
    assert "explains the recording:" in together.summary()
    alone = diagnose(day, IDEAL, nuisances=("load",))
    for name in NAMES:
        estimate, single_estimate = together.components[name], alone.components[name]
        # The same data: the difference is the tolerance of the descent, far less than an error.
        assert abs(estimate.value - single_estimate.value) < 0.3 * single_estimate.standard_error
        assert estimate.standard_error == pytest.approx(single_estimate.standard_error, rel=0.2)
        assert (estimate.verdict, estimate.identifiable) == (
            single_estimate.verdict,
            single_estimate.identifiable,
        )
    assert together.explained
    assert together.relative_residual == pytest.approx(alone.relative_residual, rel=0.02)
    assert set(alone.to_dict()) <= set(together.to_dict())


@pytest.mark.evidence
def test_the_error_falls_with_the_root_of_the_number_of_recordings() -> None:
    days = [recorded(FAULTS, seed, duration=0.3) for seed in range(4)]
    alone, four = np.array([errors(joint([day])) for day in days]), joint(days)
    # Four equal recordings have a ratio of 2; each of the four errors is accurate to about a third.
    ratio = np.sqrt(np.mean(alone**2, axis=0)) / errors(four)
    np.testing.assert_allclose(ratio, 2.0, rtol=0.25)
    assert four.explained
    assert not four.contradicting


@pytest.mark.evidence
def test_the_intervals_of_joint_diagnoses_have_their_coverage() -> None:
    rng, inside = np.random.default_rng(0), []
    for case in range(5):
        friction, backlash, gain = rng.random(3)
        faults = Faults(friction=friction, backlash=backlash, gain=gain)
        loads = rng.normal(0.0, 0.03, 3)
        days = [
            recorded(
                faults,
                10 * case + i,
                actuator=with_lumped_parameters(IDEAL, {"offset": load}),
                duration=0.2,
            )
            for i, load in enumerate(loads)
        ]
        diagnosis = joint(days)
        inside += [
            covered(faults.vector, diagnosis)[NAMES.index(name)] for name in ("friction", "backlash", "gain")
        ]
    # At least 13 of 15 intervals of 95 % contain the truth in all but 4 of 100 draws.
    assert sum(inside) >= 13


def test_the_reference_model_corrects_each_recording() -> None:
    faults, days = Faults(friction=0.3, short_b=0.2, eccentricity=0.4, gain=0.4), []
    for seed in range(3):
        whole = simulate(THESIS, Chirp(duration=0.15), faults=faults, duration=0.15, noise=0.05, seed=seed)
        days.append(Recording({name: whole[name] for name in CHANNELS[:3]}))
    diagnosis = diagnose_joint(days, THESIS, nuisances=USUAL, max_corrections=2)
    alone = diagnose(days[0], THESIS, nuisances=USUAL, max_corrections=2)
    assert diagnosis.explained
    assert sum(covered(faults.vector, diagnosis)) >= 7
    # Three recordings have errors of 1 / 1.7; a bound limits the error of a short near healthy.
    ratio = np.sqrt(np.diag(alone.covariance))[: len(diagnosis.coordinates)] / errors(diagnosis)
    assert 1.3 < np.median(ratio) < 2.6


def test_recordings_may_differ_in_length_command_channels_and_load() -> None:
    loaded = with_lumped_parameters(IDEAL, {"offset": 0.06})
    days = [
        recorded(FAULTS, 1),
        recorded(FAULTS, 2, stop_hz=9.0, duration=0.3, channels=CHANNELS[:3]),
        recorded(FAULTS, 3, actuator=loaded),
    ]
    diagnosis = joint(days)
    assert sum(covered(FAULTS.vector, diagnosis)) >= 7
    assert diagnosis.explained
    loads = [recording.nuisances["load"].value for recording in diagnosis.recordings]
    np.testing.assert_allclose(loads, [0.0, 0.0, 0.06], atol=3e-3)
    assert [recording.channels for recording in diagnosis.recordings] == [
        CHANNELS[2:],
        CHANNELS[2:3],
        CHANNELS[2:],
    ]
    assert diagnosis.time_s.shape == diagnosis.recorded.shape == diagnosis.modelled.shape
    assert np.all(np.diff(diagnosis.time_s) > 0)


def test_sensor_faults_and_reasons_are_reported_with_the_name_of_the_recording() -> None:
    first, second = recorded(FAULTS, 1), recorded(FAULTS, 2)
    current = np.array(second["current_A"])
    rows = slice(current.size // 4, current.size // 2)
    current[rows] = current[rows.start]
    spoilt = second.with_channels({**second.channels, "current_A": current}, ["a note on both", "on one"])
    diagnosis = joint([first.with_channels(first.channels, ["a note on both"]), spoilt])
    assert diagnosis.explained
    notes = [line for line in diagnosis.notes() if "on both" in line or "on one" in line]
    assert notes == ["2 recordings: a note on both.", "2 recordings: day 2: on one."]
    assert [(fault.channel, fault.kind) for fault in diagnosis.sensor_faults] == [("current_A", "frozen")]
    fault_notes = [line for line in diagnosis.notes() if "is frozen" in line]
    assert len(fault_notes) == 1
    assert fault_notes[0].startswith("Sensor fault: day 2: current_A is frozen")
    assert diagnosis.faults.vector == pytest.approx(FAULTS.vector, abs=0.01)
    # The reason against a recording of another actuator is reported with its name, in any order.
    inertia = lumped_parameters(IDEAL, ("inertia",))["inertia"]
    other = recorded(FAULTS, 3, actuator=with_lumped_parameters(IDEAL, {"inertia": 1.5 * inertia}))
    for days in ([first, other], [other, first]):
        assert any(reason.startswith("day 3: ") for reason in joint(days, max_corrections=0).reasons)


def test_a_contradicting_recording_is_named_and_no_component_has_a_verdict() -> None:
    other = recorded(Faults(friction=0.6, backlash=0.4, gain=0.4), 7)
    diagnosis = joint([recorded(FAULTS, 0), other, recorded(FAULTS, 1)])
    assert diagnosis.contradicting == ("day 7",)
    assert "friction" in diagnosis.contradicted
    assert not diagnosis.explained
    assert {component.verdict for component in diagnosis.components.values()} == {"cannot tell"}
    assert [recording.contradicts for recording in diagnosis.recordings] == [False, True, False]
    assert diagnosis.recordings[1].misfit_ratio > 1.5
    assert diagnosis.recordings[1].alone[0] == pytest.approx(0.6, abs=0.02)
    assert "Not explained: contradicting the others: day 7. " in str(diagnosis)
    assert diagnosis.to_dict()["reasons"][0].startswith("contradicting the others: day 7. ")


def test_a_separate_fit_counts_against_the_others_if_it_is_better_than_the_joint_one() -> None:
    problem = problem_of(recorded(FAULTS, 1), IDEAL)
    objective = faults_objective(problem, ("load",))
    (truth,) = objective.space.points(FAULTS.vector[np.newaxis])
    term = RecordingTerm.of(objective, len(objective.space.columns))
    joint = JointObjective((term, term), objective.space.nuisances.unit, MULTISTART.fine.step)
    other = truth + 0.2 * (np.arange(truth.size) == NAMES.index("backlash"))
    points = np.array([other, truth])[:, term.shared_places]
    covariances = np.array([1e-4 * np.eye(len(row)) for row in points])
    priors = joint.prior_deviations[: joint.shared]
    separate = AloneEstimates(points, covariances, np.ones(2), random_effects(points, covariances, priors))

    def dissent(alone: np.ndarray, together: np.ndarray) -> list[bool]:
        """Return which recordings contradict, if the first has these fits, alone and together."""
        first, second = (
            [SearchResult.at(objective, point) for point in (of, truth)] for of in (alone, together)
        )
        marked: list[bool] = dissenting(with_better_fits(separate, first, second, joint), priors).tolist()
        return marked

    assert dissenting(separate, priors).all()
    assert dissent(alone=other, together=truth) == [False, False]
    assert dissent(alone=truth, together=other) == [True, True]


def test_components_without_a_single_outlier_are_named_with_their_range() -> None:
    def day(friction: float, *, contradicts: bool) -> JointRecording:
        alone = (friction, *FAULTS.vector[1:].tolist())
        return JointRecording("day", ("current_A",), True, 0.1, 0.03, 1.0, contradicts, alone, {})

    days = [day(0.16, contradicts=False), day(0.19, contradicts=False)]
    (reason,) = on_contradictions(days, ("friction",))
    assert "contradict each other in friction (alone 0.1600 to 0.1900)" in reason
    assert not list(on_contradictions(days, ()))


def test_of_two_contradicting_recordings_neither_is_accepted() -> None:
    diagnosis = joint([recorded(FAULTS, 1), recorded(Faults(friction=0.6), 2)])
    assert diagnosis.contradicting == ("day 1", "day 2")
    assert {component.verdict for component in diagnosis.components.values()} == {"cannot tell"}


def test_a_missing_law_is_estimated_from_all_recordings(monkeypatch: pytest.MonkeyPatch) -> None:
    # `test_hidden_laws.py` tests which law is selected; a lag of the current sensors is excluded here.
    monkeypatch.setattr(
        hidden_laws, "HIDDEN", [law for law in hidden_laws.HIDDEN if law.name in ("saturation", "speed-lag")]
    )
    for module in (first_look, sensor_lag):
        monkeypatch.setattr(module, "can_show_lag", lambda _: False)
    unit = with_lumped_parameters(LAWS["saturation"].added_to(THESIS), {"saturation": 0.007})
    diagnosis = diagnose_joint([on_a_rig(unit, FAULTS, 0.2, seed=seed) for seed in range(2)], THESIS)
    assert diagnosis.explained
    assert diagnosis.laws == ("saturation",)
    (name,) = diagnosis.nuisances
    assert name == "baseline saturation"
    assert abs(diagnosis.nuisances[name].value - 0.007) <= 4 * diagnosis.nuisances[name].standard_error
    assert diagnosis.nuisances[name].standard_error < 1e-3
    assert not any(name in recording.nuisances for recording in diagnosis.recordings)
    assert "Found: saturation +0.0" in str(diagnosis)
    # Without the law, a saturation of 0.01 caused shorts of 0.02 to 0.05.
    off = np.abs(diagnosis.faults.vector - FAULTS.vector)
    assert max(np.delete(off, NAMES.index("eccentricity_phase"))) < 0.01


@pytest.mark.evidence
def test_a_varying_load_belongs_to_its_recording() -> None:
    def under(load: Load, seed: int) -> Recording:
        options: dict[str, Any] = {"duration": 0.2, "noise": 0.05, "adc_bits": 12, "seed": seed}
        whole = simulate(THESIS, Chirp(duration=0.2), faults=FAULTS, load=load, **options)
        return Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")})

    diagnosis = diagnose_joint([under(0.02, 1), under(lambda t: 0.08 * np.sin(30 * t), 2)], THESIS)
    assert diagnosis.explained
    assert diagnosis.selected == ("load_variation", "hinge")
    assert [recording.load is not None for recording in diagnosis.recordings] == [False, True]
    off = np.abs(diagnosis.faults.vector - FAULTS.vector)
    assert max(np.delete(off, NAMES.index("eccentricity_phase"))) < 0.01
    assert "load varies from -0.0" in str(diagnosis)
    assert "load_variation_" not in str(diagnosis)


def test_recordings_of_different_units_are_refused() -> None:
    days = [recorded(FAULTS, seed) for seed in range(3)]
    for day, serial in zip(days, ("A17", None, "B02"), strict=True):
        if serial:
            object.__setattr__(day, "labels", {"serial": serial})
    with pytest.raises(MethodError, match="day 2 is of unit 'B02', day 0 of unit 'A17'; a joint estimate is"):
        joint(days)
    assert joint(days[:2], max_corrections=0).explained


def test_an_empty_list_of_recordings_is_refused() -> None:
    with pytest.raises(MethodError, match="no recording to diagnose"):
        joint([])


def test_the_command_prints_one_json_object(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [tmp_path / f"day{i}.csv" for i in range(2)]
    for i, path in enumerate(files):
        whole = simulate(
            THESIS, Chirp(duration=0.2), faults=Faults(friction=0.3), duration=0.2, noise=0.05, seed=i
        )
        write_recording(Recording({name: whole[name] for name in CHANNELS[:3]}), path)
    arguments = ["diagnose", str(tmp_path), "--joint"]
    assert main([*arguments, "--json", "--workers", "1"]) == 0
    out, err = capsys.readouterr()
    assert (out.count("\n"), err) == (1, "")
    answer = json.loads(out)
    assert [recording["recording"] for recording in answer["recordings"]] == list(map(str, files))
    assert answer["suspected"] == []
    low, high = answer["faults"]["friction"]["interval95"]
    assert low < 0.3 < high
    assert main([*arguments, "--nuisance", "none", "--no-correction"]) == 0
    assert "contradicts the others" in capsys.readouterr().out
