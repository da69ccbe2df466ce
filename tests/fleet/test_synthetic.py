"""Synthetic fleets: laws against closed forms, true levels, and the processing chain."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType

import numpy as np
import polars as pl
import pytest

from cases import THESIS
from emaphm.actuator.faults import HEALTHY, NAMES
from emaphm.cli import main
from emaphm.diagnosis import diagnose
from emaphm.errors import ExecutionError
from emaphm.fleet.synthetic import FleetPlan, drawn_unit, population, tasks
from emaphm.fleet.synthetic.folder import SETTINGS, revision
from emaphm.fleet.synthetic.growth import LAWS
from emaphm.fleet.synthetic.population import FLEET, POPULATIONS, StressModel, Wear
from emaphm.fleet.synthetic.unit import aged
from emaphm.history import Entry, History
from emaphm.recording import read_recording
from emaphm.study.fleet.clairvoyant import clairvoyant
from history.made_up import diagnosis

from .files import QUICK

U = np.linspace(0, 2, 401)
PLAN = FleetPlan(units=3, flights=60, interval=100.0)


def progress(law: str, **parameters: float) -> np.ndarray:
    return LAWS[law].progress(U, parameters, np.random.default_rng(0))


def test_laws_agree_with_closed_forms() -> None:
    at_1 = np.searchsorted(U, 1.0)
    assert progress("linear") == pytest.approx(U)
    for law, parameters in (("exponential", {"growth": 2.0}), ("power law", {"exponent": 1.7})):
        assert progress(law, **parameters)[at_1] == pytest.approx(1.0)
    assert np.diff(np.log(1 + progress("exponential", growth=2.0) * np.expm1(2.0))) == pytest.approx(0.01)
    onset = progress("sudden onset", moment=0.5, slope=2.0)
    assert onset[U <= 0.5] == pytest.approx(0.0)
    assert np.diff(onset[U >= 0.5]) == pytest.approx(0.01)
    two = progress("two-phase", moment=0.5, slope=0.4, factor=3.0)
    assert np.diff(two)[[0, -1]] == pytest.approx([0.002, 0.006])
    saturating = progress("logistic", middle=0.5, width=0.15)
    assert saturating[at_1] == pytest.approx(1.0)
    assert saturating[-1] - saturating[-2] < 1e-5 < np.diff(saturating)[at_1 // 2]


def test_a_gamma_process_has_its_theoretical_mean_and_variance() -> None:
    random = np.random.default_rng(1)
    ends = np.array([LAWS["gamma process"].progress(U, {"jumps": 40.0}, random)[-1] for _ in range(2000)])
    assert ends.mean() == pytest.approx(2.0, abs=4 * np.sqrt(2 / 40 / 2000))
    assert ends.var() == pytest.approx(2 / 40, rel=0.15)


def test_stress_determines_the_rate_of_ageing() -> None:
    hours, stress = np.linspace(0, 1000, 101), StressModel()
    for heat, load, rate in ((0.0, 0.0, 1.0), (40.0, 0.0, 2.0), (0.0, 0.1, 1.331)):
        of_intervals = np.tile([[heat], [load]], (1, 10))
        assert aged(hours, of_intervals, stress, 100.0) == pytest.approx(rate * hours)
    changing = np.array([[0.0, 40.0], [0.0, 0.0]])
    assert aged(hours, changing, stress, 500.0)[[50, 100]] == pytest.approx([500.0, 1500.0])


def test_the_recorded_stress_gives_the_true_hours_of_ageing() -> None:
    for number in range(3):
        unit = drawn_unit(PLAN, number)
        flights = unit.check_flights(PLAN.interval)
        recorded = [unit.recorded_stress(i, StressModel()) for i in range(1, flights.size + 1)]
        heat = np.array([stress.temperature for stress in recorded], float) - 288.0
        load = np.array([stress.load for stress in recorded], float) / 0.1
        true = unit.ageing[[unit.row(hours) for hours in flights]]
        assert np.cumsum(PLAN.interval * 2 ** (heat / 40) * load**3) == pytest.approx(true)


def test_a_unit_ends_at_its_first_limit_and_is_independent_of_the_fleet_size() -> None:
    for number in range(6):
        unit = drawn_unit(PLAN, number)
        again = drawn_unit(replace(PLAN, units=50), number)
        assert np.array_equal(unit.vectors, again.vectors)
        beyond = {
            component.name: component.failed(unit.vectors[:, NAMES.index(component.name)])
            for component in unit.components
        }
        assert not any(values[:-1].any() for values in beyond.values())
        if unit.failure is None:
            assert not any(values[-1] for values in beyond.values())
            continue
        assert beyond[str(unit.failed)][-1]
        flights = unit.check_flights(PLAN.interval)
        assert flights[-1] < unit.failure <= flights[-1] + PLAN.interval
        # No check flight is at the hours of the failure, even if the grid of flights contains them.
        assert unit.check_flights(unit.failure / 4) == pytest.approx(unit.failure * np.arange(1, 4) / 4)


def test_the_clairvoyant_rul_of_a_unit_without_random_effects_is_exact(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wear = {"friction": Wear(MappingProxyType({"linear": 1.0}), 1.0, 2000.0, 0.6)}
    undisturbed = replace(
        FLEET,
        name="calm",
        wear=MappingProxyType(wear),
        stress=StressModel(mission_K=0, flight_K=0, mission_load=0, flight_load=0),
        drift=0.0,
        new_level=0.0,
    )
    monkeypatch.setattr(population, "POPULATIONS", {**POPULATIONS, "calm": undisturbed})
    monkeypatch.setattr("emaphm.fleet.synthetic.plan.POPULATIONS", {**POPULATIONS, "calm": undisturbed})
    plan = replace(PLAN, population="calm")
    unit = drawn_unit(plan, 0)
    (component,) = unit.components
    assert unit.failure == pytest.approx(component.life, abs=10.0)
    sample = clairvoyant(unit, 500.0, plan)
    assert sample == pytest.approx(component.life - 500.0, abs=10.0)


def fleet(folder: Path, capsys: pytest.CaptureFixture[str], *further: str) -> dict[str, object]:
    arguments = ["fleet", "simulate", "-o", str(folder), "--units", "2", "--flights", "1", "--workers", "1"]
    assert main([*arguments, "--json", *further]) == 0
    values: dict[str, object] = json.loads(capsys.readouterr().out)
    return values


@pytest.fixture
def quick_diagnoses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Diagnose without corrections; `test_cluster.py` checks the usual diagnosis against the truth."""
    quick = partial(diagnose, max_corrections=QUICK.max_corrections, nuisances=QUICK.nuisances)
    monkeypatch.setattr(tasks, "diagnose", quick)


@pytest.mark.usefixtures("one_search", "quick_diagnoses", "few_steps")
def test_one_command_runs_the_chain_and_continues_an_interrupted_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "fleet"
    simulated = fleet(folder, capsys, "--simulate-only")
    assert simulated["synthetic"] is True
    assert not (folder / "history.sqlite").exists()
    complete = fleet(folder, capsys)
    assert complete["recordings"] == 2
    units = complete["units"]
    assert isinstance(units, list)
    assert all(result["prognosis"]["synthetic"] for result in units)
    written = {
        path: path.stat().st_mtime_ns for path in folder.rglob("*.parquet") if "truth" not in path.parts
    }
    assert fleet(folder, capsys) == complete
    assert {path: path.stat().st_mtime_ns for path in written} == written
    line = ["fleet", "simulate", "-o", str(folder), "--units", "2", "--flights", "1", "--workers", "1"]
    assert main(line) == 0
    output = capsys.readouterr().out
    assert "mostly from the prior, with explained diagnoses of fewer than 3 flights: SYNTHETIC-0000" in output
    assert f"emaphm prognose --unit UNIT --db {folder / 'history.sqlite'}" in output
    with History.open(folder / "history.sqlite") as history:
        assert [[result.hours for result in unit.diagnoses()] for unit in history.units()] == [[80.0], [80.0]]
        kept = [(flight.load, flight.temperature) for unit in history.units() for flight in unit.flights()]
    listed = pl.read_csv(folder / "flights.csv").select("load_Nm", "temperature_K").rows()
    assert None not in {value for row in kept for value in row}
    assert kept == [pytest.approx(row) for row in listed]
    assert read_recording(next(iter(written)), THESIS).labels["origin"] == "synthetic"
    assert main(["fleet", "simulate", "-o", str(folder), "--units", "3", "--flights", "1"]) == 2
    assert "holds another synthetic fleet: 'plan.units' (2 there, 3 here)" in capsys.readouterr().err
    settings = folder / SETTINGS
    settings.write_text(settings.read_text().replace(revision(), "0123456789ab"))
    assert main(["fleet", "simulate", "-o", str(folder), "--units", "2", "--flights", "1"]) == 2
    output = capsys.readouterr().err
    assert f"made by another version of emaphm (0123456789ab; this is {revision()})" in output
    assert "give another folder with -o" in output


def test_a_history_contains_only_one_synthetic_fleet(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    db = tmp_path / "shared.sqlite"

    def refuse(*_: object) -> None:
        raise ExecutionError("a diagnosis is to be made")

    monkeypatch.setattr("emaphm.fleet.synthetic.chain.diagnose_flight", refuse)
    line = ["fleet", "simulate", "--units", "1", "--flights", "1", "--workers", "1", "--db", str(db), "-o"]
    for seed in ("0", "1"):
        assert main([*line, str(tmp_path / seed), "--seed", seed, "--simulate-only"]) == 0
    (first,) = (tmp_path / "0").rglob("flight-*.parquet")
    with History.open(db, create=True) as history:
        result = diagnosis(1)
        history.add(Entry("SYNTHETIC-0000", "SYNTHETIC", 80.0), read_recording(first, THESIS), result)
    for seed, complaint in (
        ("0", "a diagnosis is to be made"),  # the same fleet is continued
        ("1", "unit 'SYNTHETIC-0000' there is of another synthetic fleet"),
    ):
        assert main([*line, str(tmp_path / seed), "--seed", seed]) == 2
        assert complaint in capsys.readouterr().err


@pytest.mark.parametrize("place", ["missing/fleet.sqlite", "notes.txt"])
def test_an_unusable_history_is_refused_before_the_folder_is_made(
    place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "notes.txt").write_text("no database")
    db = tmp_path / place
    line = ["fleet", "simulate", "-o", str(tmp_path / "fleet"), "--units", "1", "--flights", "1"]
    assert main([*line, "--workers", "1", "--db", str(db)]) == 2
    assert str(db) in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [tmp_path / "notes.txt"]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--units", "0"], "0 units cannot be simulated"),
        (["--flights", "-1"], "-1 flights cannot be simulated"),
        (["--interval", "nan"], "an interval of nan h"),
        (["--population", "fleat"], "unknown population 'fleat' (did you mean 'fleet'?)"),
        (["--horizon", "0"], "a horizon of 0 h"),
        (["--seed", "-1"], "--seed -1 is negative"),
        (["--workers", "0"], "--workers 0"),
    ],
)
def test_invalid_plans_are_refused(
    arguments: list[str], complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fleet", "simulate", "-o", str(tmp_path / "fleet"), *arguments]) == 2
    assert complaint in capsys.readouterr().err
    assert not (tmp_path / "fleet").exists()


def test_a_folder_with_other_content_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("mine", encoding="utf-8")
    from emaphm.fleet.synthetic import FleetFolder

    with pytest.raises(ExecutionError, match="holds something else than a synthetic fleet"):
        FleetFolder(tmp_path).begin(PLAN)


def test_a_new_unit_is_nearly_healthy() -> None:
    new = np.array([drawn_unit(PLAN, i).new for i in range(30)])
    plain = [0, 1, 2, 3, 4, 5, 7]
    assert np.abs(new[:, plain] - HEALTHY.vector[plain]).max() < 0.05
