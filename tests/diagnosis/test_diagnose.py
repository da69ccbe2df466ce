"""What a diagnosis promises whatever it finds: its schema, its bits, the other methods, its refusals."""

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


def without_seconds(found: Diagnosis) -> str:
    return json.dumps({name: value for name, value in found.to_dict().items() if name != "seconds"})


@pytest.mark.parametrize("given", [{"time_s": [0.0]}, "flight.csv", None])
def test_what_is_no_recording_is_refused(given: Any) -> None:
    with pytest.raises(RecordingError, match="give what read_recording returns"):
        diagnose(given, THESIS)


def test_impossible_searches_are_refused(mixed: Recording) -> None:
    with pytest.raises(MethodError, match="max_corrections=-1"):
        diagnose(mixed, THESIS, max_corrections=-1)
    with pytest.raises(MethodError, match=r"not 'load'; give \['load'\]"):
        diagnose(mixed, THESIS, nuisances="load")


def test_a_diagnosis_is_written_whole_or_refused(mixed: Recording, tmp_path: Path) -> None:
    diagnosis = diagnose(mixed, THESIS, max_corrections=0, nuisances=())
    path = tmp_path / "found.json"
    content = diagnosis.to_json(path)
    assert path.read_text(encoding="utf-8") == content + "\n"
    with pytest.raises(OutputError, match="cannot be written"):
        diagnosis.to_json(tmp_path / "absent" / "found.json")
    assert [one.name for one in tmp_path.iterdir()] == ["found.json"]


@pytest.fixture(scope="module")
def mixed() -> Recording:
    return reference_recordings([MIXED.vector], noise=0.05, duration=0.15)[0]


@pytest.fixture(scope="module")
def found(mixed: Recording) -> Diagnosis:
    """Return the diagnosis with the nuisances that are estimated by default, and nothing else looked for."""
    return diagnose(mixed, THESIS, nuisances=USUAL, seed=4)


def test_the_json_has_what_the_design_asks_for(found: Diagnosis, mixed: Recording) -> None:
    read = json.loads(found.to_json())
    assert list(read["faults"]) == list(NAMES)
    for name, component in read["faults"].items():
        assert set(component) >= {"value", "standard_error", "interval95", "identifiable", "verdict"}
        assert component["value"] == getattr(found.faults, name)
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


def test_the_json_holds_no_number_that_json_lacks(found: Diagnosis) -> None:
    def refuse(text: str) -> None:
        pytest.fail(f"{text} is no JSON")

    json.loads(found.to_json(), parse_constant=refuse)


def test_the_json_is_written_where_asked(found: Diagnosis, tmp_path: Path) -> None:
    text = found.to_json(tmp_path / "found.json")
    assert json.loads((tmp_path / "found.json").read_text(encoding="utf-8")) == json.loads(text)


def test_the_table_names_every_component_and_its_truth(found: Diagnosis) -> None:
    table = found.table(MIXED).splitlines()
    assert [line.split()[0] for line in table[2:]] == list(NAMES)
    assert [float(line.split()[1]) for line in table[2:]] == MIXED.vector.tolist()
    assert f"seed {found.seed}" in found.summary()


def test_the_residual_is_recorded_less_modelled(found: Diagnosis, mixed: Recording) -> None:
    np.testing.assert_array_equal(found.recorded, mixed["current_A"])
    rms = np.sqrt(np.mean((found.recorded - found.modelled) ** 2))
    assert found.residual_rms_A == pytest.approx(rms)
    assert found.relative_residual == pytest.approx(rms / np.sqrt(np.mean(found.recorded**2)))


def test_same_seed_same_bits_but_for_the_time(found: Diagnosis, mixed: Recording) -> None:
    again = diagnose(mixed, THESIS, nuisances=USUAL, seed=4)
    assert without_seconds(again) == without_seconds(found)
    np.testing.assert_array_equal(again.modelled, found.modelled)


def test_another_seed_starts_elsewhere_and_ends_at_the_same_faults(
    found: Diagnosis, mixed: Recording
) -> None:
    other = diagnose(mixed, THESIS, nuisances=USUAL, seed=5)
    assert without_seconds(other) != without_seconds(found)
    # From the current alone heat and a short in all phases look alike: what is known is known twice.
    for name, estimate in found.components.items():
        errors = np.hypot(estimate.standard_error, other.components[name].standard_error)
        assert abs(estimate.value - other.components[name].value) <= 4 * errors
    assert found.components["friction"].standard_error < 0.005


def test_the_number_of_workers_changes_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    recording = simulate(THESIS, Chirp(duration=0.1), faults=MIXED, duration=0.1)
    # As if so short a recording were worth threads: two groups of actuators are shared out already.
    monkeypatch.setattr(running, "WORTH_A_THREAD", 1)
    alone, together = (
        diagnose(recording, THESIS, max_corrections=1, nuisances=USUAL, workers=workers) for workers in (1, 2)
    )
    assert without_seconds(alone) == without_seconds(together)
    np.testing.assert_array_equal(alone.modelled, together.modelled)


@pytest.mark.parametrize("turns", [0, 2])
def test_evaluations_are_the_runs_of_the_averaged_model(
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
            # Runs of the first rows alone do not count, of a short recording not even if these are all.
            whole = (model, inputs.samples) == (AVERAGED, mixed.samples) and not at_first
            counted += plant.count if whole else 0
            return run(model, plant, inputs, *rest, **options)

        return counted_run

    for name in ("run", "observe_batch"):
        monkeypatch.setattr(problem, name, counting(getattr(problem, name)))
    reported = diagnose(mixed, THESIS, max_corrections=turns).evaluations
    assert reported == counted


QUICK = ("hybrid", "dragonfly", "random+lsq", "l-shade")
"""A method of each kind: with starts of its own or an optimiser's, and an optimiser alone, ours or another's.

That the other optimisers report each population is tested in `tests/optimizers`.
"""


@pytest.mark.parametrize(
    "method",
    [
        name if name in QUICK else pytest.param(name, marks=pytest.mark.evidence)
        for name in (*METHODS, "random+lsq", "pymoo-ga")
    ],
)
def test_progress_only_grows(method: str) -> None:
    brief = simulate(THESIS, Chirp(duration=0.02), duration=0.02)
    reported: list[float] = []
    diagnose(brief, THESIS, method=method, max_corrections=0, on_progress=reported.append)
    assert len(reported) > 5
    assert all(0 <= one <= two <= 1 for one, two in itertools.pairwise(reported))


# Nuisances.


def with_channels(recording: Recording, *names: str) -> Recording:
    return Recording({name: recording[name] for name in ("time_s", "command_rad", *names)})


def test_heat_is_identified_by_the_voltage_and_collinear_without() -> None:
    whole = simulate(THESIS, Chirp(duration=0.2), faults=MIXED, duration=0.2, load=0.1, noise=0.05)
    blind = diagnose(with_channels(whole, "current_A"), THESIS, nuisances=USUAL)
    assert blind.channels == ("current_A",)
    # Heat and a short in all phases differ in resistance alone, which a current hardly shows.
    assert not blind.nuisances["temperature"].known
    (group,) = blind.collinear_sets
    assert group.members == ("short_a", "short_b", "short_c", "temperature")
    assert f"Known only in combination: {group}" in blind.notes()
    seeing = diagnose(with_channels(whole, "current_A", "voltage_V"), THESIS, nuisances=USUAL)
    assert seeing.channels == ("current_A", "voltage_V")
    heat = seeing.nuisances["temperature"]
    assert heat.known
    assert abs(heat.value) < 2 * heat.standard_error + 1.0  # nominal, to a kelvin of what models leave
    for found in (blind, seeing):
        assert found.nuisances["load"].known
        assert found.nuisances["load"].value == pytest.approx(0.1, abs=0.005)
    assert seeing.collinear_sets == ()
    assert blind.to_dict()["groups"][0]["members"] == list(group.members)
    assert seeing.to_dict()["nuisances"]["load"]["unit"] == "N·m"


def test_no_nuisance_is_estimated_where_none_is_asked_for(mixed: Recording) -> None:
    diagnosis = diagnose(mixed, THESIS, nuisances=(), max_corrections=0)
    assert diagnosis.nuisances == {}
    assert diagnosis.notes() == []
    assert len(diagnosis.coordinates) == 8


# The other methods, fitnesses and models.


@pytest.mark.parametrize(
    ("method", "fitness"),
    [
        ("dragonfly", "least_squares"),
        ("dragonfly", "total_least_squares"),
        ("dragonfly-thesis", "thesis"),
    ],
)
def test_a_swarm_finds_a_single_fault(method: str, fitness: str) -> None:
    truth = Faults(friction=0.5)
    recording = reference_recordings([truth.vector], duration=0.2)[0]
    diagnosis = diagnose(recording, THESIS, method=method, fitness=fitness)
    assert (diagnosis.method, diagnosis.fitness_name) == (method, fitness)
    # 50 agents, 100 iterations, and what follows: derivatives about eight points, two runs for each of eight,
    # of the recorded channel and, where it leaves something open, of the others.
    assert 5000 < diagnosis.evaluations <= 5000 + 2 * 8 * 2 * 8 + 10
    # A swarm ends with its iterations, wherever it is: components that hardly show may be far off (the thesis
    # has errors up to 100 %), but nine tenths of what no fault at all leaves are explained.
    assert diagnosis.faults.friction == pytest.approx(0.5, abs=0.1)
    problem = problem_of(recording, THESIS)
    (healthy,) = COST_FUNCTIONS[fitness](
        problem.recorded, problem.predict_primary(HEALTHY), problem.inputs.interval
    )
    assert diagnosis.fitness < 0.1 * healthy
    again = diagnose(recording, THESIS, method=method, fitness=fitness)
    assert without_seconds(again) == without_seconds(diagnosis)


def test_the_monitor_model_finds_what_it_recorded_itself() -> None:
    truth = Faults(gain=0.75)
    recording = simulate(THESIS, Chirp(duration=0.15), faults=truth, model="monitor", duration=0.15)

    def error(seed: int) -> float:
        diagnosis = diagnose(recording, THESIS, model="monitor", method="dragonfly", seed=seed)
        assert diagnosis.model == "monitor"
        return float(error_percent(truth.vector, diagnosis.faults.vector))

    # Nothing but the swarm's luck stands between it and its own model: one of three runs must arrive.
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
def test_an_option_that_cannot_be_is_refused(options: dict[str, Any], message: str, mixed: Recording) -> None:
    with pytest.raises(EmaphmError, match=message) as caught:
        diagnose(mixed, THESIS, **options)
    assert "\n" not in str(caught.value)


def bare() -> Actuator:
    """Return an actuator with neither friction, backlash nor windings."""
    values = THESIS.model_dump() | {"electrical": None}
    names = (f"{kind}_friction_{side}" for kind in ("static", "dynamic") for side in ("motor", "user"))
    values["mechanics"] |= dict.fromkeys(names, 0.0) | {"backlash": 0.0}
    return Actuator.from_dict(values)


def test_an_actuator_that_can_show_little_is_asked_for_that() -> None:
    ideal = bare()
    recording = simulate(
        ideal, Chirp(duration=0.2), faults=Faults(gain=0.7), duration=0.2, sampling="instant"
    )
    diagnosis = diagnose(recording, ideal)
    # Every drive has a position gain, so that no actuator can show no fault.
    assert diagnosis.coordinates == ("gain", "load")
    assert diagnosis.faults.gain == pytest.approx(0.7, abs=0.01)
    assert all(not diagnosis.components[name].identifiable for name in NAMES[:7])


def test_a_recording_in_foreign_units_is_refused(mixed: Recording) -> None:
    milliamperes = Recording(dict(mixed.channels) | {"current_A": 1e3 * mixed["current_A"]})
    with pytest.raises(RecordingError, match="milliamperes"):
        diagnose(milliamperes, THESIS)
