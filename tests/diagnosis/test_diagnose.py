"""The interface of a diagnosis: its JSON, reproducibility, other methods and refused arguments."""

import importlib
import itertools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cases import HEALTHY, THESIS, USUAL, reference_recordings
from emaphm.actuator import NAMES, Actuator, Chirp, Faults
from emaphm.diagnosis import Diagnosis, diagnose, error_percent
from emaphm.errors import EmaphmError, MethodError, OutputError, RecordingError
from emaphm.estimation import METHODS
from emaphm.estimation.bias_correction import MAX_CORRECTIONS
from emaphm.estimation.cost_functions import COST_FUNCTIONS
from emaphm.estimation.discrepancy import REFERENCE_RUNS
from emaphm.estimation.posing import problem_of
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate
from emaphm.simulation import AVERAGED, Inputs, Model, Plant
from emaphm.simulation.engine import running
from emaphm.version import VERSION

MIXED = Faults(0.2, 0.3, 0.1, 0.4, 0.2, 0.5, 0.3, 0.6)


def without_seconds(diagnosis: Diagnosis) -> str:
    return json.dumps({name: value for name, value in diagnosis.to_dict().items() if name != "seconds"})


@pytest.mark.parametrize("given", [{"time_s": [0.0]}, "flight.csv", None])
def test_arguments_that_are_no_recording_are_refused(given: Any) -> None:
    with pytest.raises(RecordingError, match="give what read_recording returns"):
        diagnose(given, THESIS)


def test_impossible_searches_are_refused(mixed: Recording) -> None:
    with pytest.raises(MethodError, match="max_corrections=-1"):
        diagnose(mixed, THESIS, max_corrections=-1)
    with pytest.raises(MethodError, match=r"not 'load'; give \['load'\]"):
        diagnose(mixed, THESIS, nuisances="load")


def test_a_diagnosis_is_written_completely_or_refused(mixed: Recording, tmp_path: Path) -> None:
    diagnosis = diagnose(mixed, THESIS, max_corrections=0, nuisances=())
    path = tmp_path / "found.json"
    content = diagnosis.to_json(path)
    assert path.read_text(encoding="utf-8") == content + "\n"
    with pytest.raises(OutputError, match="cannot be written"):
        diagnosis.to_json(tmp_path / "absent" / "found.json")
    assert [file.name for file in tmp_path.iterdir()] == ["found.json"]


@pytest.fixture(scope="module")
def mixed() -> Recording:
    return reference_recordings([MIXED.vector], noise=0.05, duration=0.15)[0]


@pytest.fixture(scope="module")
def diagnosis(mixed: Recording) -> Diagnosis:
    """Return the diagnosis with the default nuisances and no others."""
    return diagnose(mixed, THESIS, nuisances=USUAL, seed=4)


def test_the_json_has_the_documented_content(diagnosis: Diagnosis, mixed: Recording) -> None:
    read = json.loads(diagnosis.to_json())
    assert list(read["faults"]) == list(NAMES)
    for name, component in read["faults"].items():
        assert set(component) >= {"value", "standard_error", "interval95", "identifiable", "verdict"}
        assert component["value"] == getattr(diagnosis.faults, name)
        low, high = component["interval95"]
        assert low <= component["value"] <= high
        assert isinstance(component["identifiable"], bool)
        assert component["verdict"] in {"healthy", "degraded", "cannot tell"}
    assert read["k"] == [read["faults"][name]["value"] for name in NAMES]
    assert (read["method"], read["model"], read["fitness_name"]) == ("hybrid", "averaged", "least_squares")
    assert read["residual_rms_A"] == pytest.approx(np.sqrt(read["fitness"]))
    assert read["explained"] is True
    assert (read["seed"], read["version"], read["actuator"]) == (4, VERSION, "thesis")
    assert read["recording"] == mixed.source
    assert read["evaluations"] > 128
    assert REFERENCE_RUNS < read["reference_runs"] <= REFERENCE_RUNS * (1 + MAX_CORRECTIONS)
    assert 0 < read["seconds"] < 60
    matrix = np.array(read["covariance"]["matrix"])
    # Eight faults, and the two nuisances that are estimated by default.
    assert matrix.shape == (10, 10)
    assert read["covariance"]["coordinates"][8:] == ["load", "temperature"]
    assert np.linalg.eigvalsh(matrix)[0] > 0
    assert len(read["covariance"]["coordinates"]) == 10


def test_the_json_has_no_nan_or_infinity(diagnosis: Diagnosis) -> None:
    def refuse(text: str) -> None:
        pytest.fail(f"{text} is no JSON")

    json.loads(diagnosis.to_json(), parse_constant=refuse)


def test_the_json_is_written_to_the_given_path(diagnosis: Diagnosis, tmp_path: Path) -> None:
    text = diagnosis.to_json(tmp_path / "found.json")
    assert json.loads((tmp_path / "found.json").read_text(encoding="utf-8")) == json.loads(text)


def test_the_table_has_each_component_and_its_truth(diagnosis: Diagnosis) -> None:
    table = diagnosis.table(MIXED).splitlines()
    assert [line.split()[0] for line in table[2:]] == list(NAMES)
    assert [float(line.split()[1]) for line in table[2:]] == MIXED.vector.tolist()
    assert f"seed {diagnosis.seed}" in diagnosis.summary()


def test_the_residual_is_the_recorded_minus_the_modelled_current(
    diagnosis: Diagnosis, mixed: Recording
) -> None:
    np.testing.assert_array_equal(diagnosis.recorded, mixed["current_A"])
    rms = np.sqrt(np.mean((diagnosis.recorded - diagnosis.modelled) ** 2))
    assert diagnosis.residual_rms_A == pytest.approx(rms)
    assert diagnosis.relative_residual == pytest.approx(rms / np.sqrt(np.mean(diagnosis.recorded**2)))


def test_the_same_seed_gives_the_same_bits_except_for_the_time(
    diagnosis: Diagnosis, mixed: Recording
) -> None:
    again = diagnose(mixed, THESIS, nuisances=USUAL, seed=4)
    assert without_seconds(again) == without_seconds(diagnosis)
    np.testing.assert_array_equal(again.modelled, diagnosis.modelled)


def test_another_seed_gives_the_same_faults_within_their_errors(
    diagnosis: Diagnosis, mixed: Recording
) -> None:
    other = diagnose(mixed, THESIS, nuisances=USUAL, seed=5)
    assert without_seconds(other) != without_seconds(diagnosis)
    # With the current alone, heat and a short in all phases are collinear: only the errors are compared.
    for name, estimate in diagnosis.components.items():
        errors = np.hypot(estimate.standard_error, other.components[name].standard_error)
        assert abs(estimate.value - other.components[name].value) <= 4 * errors
    assert diagnosis.components["friction"].standard_error < 0.005


def test_the_number_of_workers_changes_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    recording = simulate(THESIS, Chirp(duration=0.1), faults=MIXED, duration=0.1)
    # Threads are forced for this short recording: two groups of actuators are already distributed.
    monkeypatch.setattr(running, "WORTH_A_THREAD", 1)
    alone, together = (
        diagnose(recording, THESIS, max_corrections=1, nuisances=USUAL, workers=workers) for workers in (1, 2)
    )
    assert without_seconds(alone) == without_seconds(together)
    np.testing.assert_array_equal(alone.modelled, together.modelled)


@pytest.mark.parametrize("turns", [0, 2])
def test_evaluations_count_the_runs_of_the_averaged_model(
    mixed: Recording, turns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = importlib.import_module("emaphm.estimation.problem")
    start = importlib.import_module("emaphm.estimation.rows.moving_start")
    first_rows = start.first_rows
    counted, at_first = 0, False

    def of_first_rows(*arguments: Any) -> Any:
        nonlocal at_first
        at_first = True
        rows = first_rows(*arguments)
        at_first = False
        return rows

    monkeypatch.setattr(start, "first_rows", of_first_rows)

    def counting(run: Callable[..., Any]) -> Callable[..., Any]:
        def counted_run(model: Model, plant: Plant, inputs: Inputs, *rest: Any, **options: Any) -> Any:
            nonlocal counted
            # Runs of the first rows do not count, even if they are all rows of a short recording.
            whole = (model, inputs.samples) == (AVERAGED, mixed.samples) and not at_first
            counted += plant.count if whole else 0
            return run(model, plant, inputs, *rest, **options)

        return counted_run

    for name in ("run", "observe_batch"):
        monkeypatch.setattr(problem, name, counting(getattr(problem, name)))
    reported = diagnose(mixed, THESIS, max_corrections=turns).evaluations
    assert reported == counted


QUICK = ("hybrid", "dragonfly", "random+lsq", "l-shade")
"""A method of each kind: with its own starts or those of an optimiser; an optimiser alone, ours or external.

`tests/optimizers` tests that the other optimisers report each population.
"""


@pytest.mark.parametrize(
    "method",
    [
        name if name in QUICK else pytest.param(name, marks=pytest.mark.evidence)
        for name in (*METHODS, "random+lsq", "pymoo-ga")
    ],
)
def test_progress_increases(method: str) -> None:
    brief = simulate(THESIS, Chirp(duration=0.02), duration=0.02)
    reported: list[float] = []
    diagnose(brief, THESIS, method=method, max_corrections=0, on_progress=reported.append)
    assert len(reported) > 5
    assert all(0 <= before <= after <= 1 for before, after in itertools.pairwise(reported))


# Nuisances.


def with_channels(recording: Recording, *names: str) -> Recording:
    return Recording({name: recording[name] for name in ("time_s", "command_rad", *names)})


def test_heat_is_identified_by_the_voltage_and_collinear_without() -> None:
    whole = simulate(THESIS, Chirp(duration=0.2), faults=MIXED, duration=0.2, load=0.1, noise=0.05)
    by_current = diagnose(with_channels(whole, "current_A"), THESIS, nuisances=USUAL)
    assert by_current.channels == ("current_A",)
    # Heat and a short in all phases differ only in resistance, to which the current is insensitive.
    assert not by_current.nuisances["temperature"].known
    (group,) = by_current.collinear_sets
    assert group.members == ("short_a", "short_b", "short_c", "temperature")
    assert f"Known only in combination: {group}" in by_current.notes()
    with_voltage = diagnose(with_channels(whole, "current_A", "voltage_V"), THESIS, nuisances=USUAL)
    assert with_voltage.channels == ("current_A", "voltage_V")
    heat = with_voltage.nuisances["temperature"]
    assert heat.known
    assert (
        abs(heat.value) < 2 * heat.standard_error + 1.0
    )  # nominal, within 1 K by the difference of the models
    for diagnosis in (by_current, with_voltage):
        assert diagnosis.nuisances["load"].known
        assert diagnosis.nuisances["load"].value == pytest.approx(0.1, abs=0.005)
    assert with_voltage.collinear_sets == ()
    assert by_current.to_dict()["groups"][0]["members"] == list(group.members)
    assert with_voltage.to_dict()["nuisances"]["load"]["unit"] == "N·m"


def test_no_nuisance_is_estimated_if_none_is_requested(mixed: Recording) -> None:
    diagnosis = diagnose(mixed, THESIS, nuisances=(), max_corrections=0)
    assert diagnosis.nuisances == {}
    assert diagnosis.notes() == []
    assert len(diagnosis.coordinates) == 8


# Other methods, fitnesses and models.


@pytest.mark.parametrize(
    ("method", "fitness"),
    [
        ("dragonfly", "least_squares"),
        ("dragonfly", "total_least_squares"),
        ("dragonfly-thesis", "thesis"),
    ],
)
def test_a_swarm_estimates_a_single_fault(method: str, fitness: str) -> None:
    truth = Faults(friction=0.5)
    recording = reference_recordings([truth.vector], duration=0.2)[0]
    diagnosis = diagnose(recording, THESIS, method=method, fitness=fitness)
    assert (diagnosis.method, diagnosis.fitness_name) == (method, fitness)
    # 50 agents, 100 iterations, then derivatives about eight points, two runs for each of eight coordinates,
    # of the recorded channel and, where components are not identifiable, of the other channels.
    assert 5000 < diagnosis.evaluations <= 5000 + 2 * 8 * 2 * 8 + 10
    # A swarm ends after its iterations at any point: components with little effect may deviate (the thesis
    # has errors up to 100 %), but the fitness is less than a tenth of that without faults.
    assert diagnosis.faults.friction == pytest.approx(0.5, abs=0.1)
    problem = problem_of(recording, THESIS)
    (healthy,) = COST_FUNCTIONS[fitness](
        problem.recorded, problem.predict_primary(HEALTHY), problem.inputs.interval
    )
    assert diagnosis.fitness < 0.1 * healthy


def test_the_monitor_model_estimates_a_fault_from_its_own_recording() -> None:
    truth = Faults(gain=0.75)
    recording = simulate(THESIS, Chirp(duration=0.15), faults=truth, model="monitor", duration=0.15)

    def error(seed: int) -> float:
        diagnosis = diagnose(recording, THESIS, model="monitor", method="dragonfly", seed=seed)
        assert diagnosis.model == "monitor"
        return float(error_percent(truth.vector, diagnosis.faults.vector))

    # The model is exact, and only the convergence of the swarm is random: one of three runs must converge.
    assert any(error(seed) <= 1.0 for seed in range(3))


def test_least_squares_are_refused_where_the_model_switches() -> None:
    recording = simulate(THESIS, Chirp(duration=0.1), model="monitor", duration=0.1)
    with pytest.raises(MethodError, match="needs derivatives, which the monitor model's switching makes"):
        diagnose(recording, THESIS, model="monitor", max_corrections=0)


# Refusals.


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "hybird"}, r"unknown method 'hybird' \(did you mean 'hybrid'\?\)"),
        ({"method": "dragon-fly"}, r"did you mean 'dragonfly'"),
        ({"model": "avreaged"}, r"unknown model 'avreaged' \(did you mean 'averaged'\?\)"),
        ({"fitness": "least_square"}, r"unknown fitness 'least_square' \(did you mean 'least_squares'\?\)"),
        (
            {"fitness": "thesis"},
            r"'hybrid' minimises least_squares; choose an optimiser alone for fitness 'thesis'",
        ),
        ({"seed": -1}, r"seed -1 is negative"),
        ({"seed": -1, "method": "dragonfly"}, r"seed -1 is negative"),
    ],
)
def test_impossible_options_are_refused(options: dict[str, Any], message: str, mixed: Recording) -> None:
    with pytest.raises(EmaphmError, match=message) as caught:
        diagnose(mixed, THESIS, **options)
    assert "\n" not in str(caught.value)


def bare() -> Actuator:
    """Return an actuator without friction, backlash and windings."""
    values = THESIS.model_dump() | {"electrical": None}
    names = (f"{kind}_friction_{side}" for kind in ("static", "dynamic") for side in ("motor", "user"))
    values["mechanics"] |= dict.fromkeys(names, 0.0) | {"backlash": 0.0}
    return Actuator.from_dict(values)


def test_only_faults_with_an_effect_are_estimated() -> None:
    ideal = bare()
    recording = simulate(
        ideal, Chirp(duration=0.2), faults=Faults(gain=0.7), duration=0.2, sampling="instant"
    )
    diagnosis = diagnose(recording, ideal)
    # Every drive has a position gain, so that every actuator has at least one estimable fault.
    assert diagnosis.coordinates == ("gain", "load")
    assert diagnosis.faults.gain == pytest.approx(0.7, abs=0.01)
    assert all(not diagnosis.components[name].identifiable for name in NAMES[:7])


def test_a_recording_in_foreign_units_is_refused(mixed: Recording) -> None:
    milliamperes = Recording(dict(mixed.channels) | {"current_A": 1e3 * mixed["current_A"]})
    with pytest.raises(RecordingError, match="milliamperes"):
        diagnose(milliamperes, THESIS)
