"""The fitness study: fitness at the true faults, compared with calculations from the recorded currents."""

import numpy as np
import polars as pl
import pytest
from matplotlib.colors import to_hex

from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.errors import MethodError
from emaphm.estimation.cost_functions import COST_FUNCTIONS
from emaphm.plotting.fitness_scans import COLOURS, TRUTH, draw_scans
from emaphm.simulated_recording import simulate
from emaphm.simulation.laws.angles import wrap
from emaphm.simulation.laws.commutation import demand_sign
from emaphm.study.thesis import published
from emaphm.study.thesis.fitness_study import GRID, MODELS, fitness_study, fitness_table, grid_distance

ACTUATOR = Actuator.thesis()


@pytest.fixture(scope="module")
def study() -> pl.DataFrame:
    return fitness_study(ACTUATOR)


def test_each_state_and_form_occurs_once(study: pl.DataFrame) -> None:
    forms = study.select("fault", "level", "model", "equivalent", "fitness")
    assert forms.is_unique().all()
    assert forms.height == len(published.FITNESS) * len(MODELS) * 3 * len(COST_FUNCTIONS)
    assert sum(study.null_count().row(0)) == 0


@pytest.mark.parametrize("state", published.FITNESS, ids=lambda state: f"{state.level} {state.fault}")
def test_the_grid_contains_the_truth(state: published.PrintedFitness, study: pl.DataFrame) -> None:
    truth = getattr(state.faults, state.fault)
    assert truth in GRID
    rows = study.filter(pl.col("fault") == state.fault, pl.col("level") == state.level)
    assert rows["truth"].unique().to_list() == [truth]
    assert all(
        scan[round(100 * truth)] == value and min(scan) == least
        for scan, value, least in rows.select("scan", "value", "least").iter_rows()
    )


def _rows(study: pl.DataFrame, **values: str) -> pl.DataFrame:
    return study.filter(pl.col(name) == value for name, value in values.items())


@pytest.mark.parametrize(
    ("equivalent", "channel"), [("torque", "current_A"), ("magnitude", "current_magnitude_A")]
)
def test_the_value_at_the_truth_equals_that_of_two_separate_runs(
    study: pl.DataFrame, equivalent: str, channel: str
) -> None:
    """Simulate both models on the rig and compare their channels directly, without problem, batch or scan."""
    reference, averaged = (
        simulate(ACTUATOR, Chirp(), faults=Faults(backlash=0.75), model=name)
        for name in ("reference", "averaged")
    )
    expected = np.sqrt(np.mean((reference[channel] - averaged["current_A"]) ** 2))
    forms = {"model": "averaged", "equivalent": equivalent, "fitness": "least_squares"}
    value = np.sqrt(_rows(study, fault="backlash", level="high", **forms)["value"].item())
    # The study drives the model with the recorded command, a curve through its rows: not further from a chirp
    # of 15 Hz and 5e-3 rad than a chord, h²/8 × 5e-3 (2 pi 15)², times the gains of the thesis.
    departure = 2e-4**2 / 8 * 5e-3 * (2 * np.pi * 15) ** 2
    assert abs(value - expected) < departure * 1e5 * 5e-2 / 0.0752  # 0.015 A


def test_ratios_are_to_the_nominal_state_of_the_same_fault(study: pl.DataFrame) -> None:
    for _, rows in study.group_by("fault", "model", "equivalent", "fitness"):
        by_level = {row["level"]: row for row in rows.iter_rows(named=True)}
        for row in by_level.values():
            assert row["ratio"] * by_level["nominal"]["value"] == pytest.approx(row["value"])
            assert row["printed_ratio"] * by_level["nominal"]["printed"] == pytest.approx(row["printed"])


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("level", ["nominal", "low"])
def test_the_torque_current_estimates_shorts_nearer_to_the_truth(
    study: pl.DataFrame, model: str, level: str
) -> None:
    """Ripple of the idle phase adds to the magnitude and cancels in the torque: more current, more short."""
    forms = {"model": model, "fault": "short_a", "level": level, "fitness": "least_squares"}
    torque = _rows(study, equivalent="torque", **forms)["bias_points"].item()
    magnitude = _rows(study, equivalent="magnitude", **forms)["bias_points"].item()
    assert abs(torque) < magnitude


@pytest.mark.parametrize(("level", "short"), [("nominal", 0.0), ("low", 0.2), ("high", 0.7)])
def test_the_bias_of_the_magnitude_follows_from_its_surplus_of_current(
    study: pl.DataFrame, level: str, short: float
) -> None:
    """While phase a conducts, k falls by half its short: c times the current is made by (1 - k3/2)/c."""
    recording = simulate(ACTUATOR, Chirp(), faults=Faults(short_a=short))
    conducting = demand_sign(wrap(2 * recording["angle_rad"])) != 0
    torque, magnitude = recording["current_A"][conducting], recording["current_magnitude_A"][conducting]
    surplus = float(torque @ magnitude / (torque @ torque))
    assert 1.02 < surplus < 1.05
    expected = 2 * (1 - (1 - short / 2) / surplus)
    forms = {"model": "averaged", "equivalent": "magnitude", "fitness": "least_squares"}
    estimate = _rows(study, fault="short_a", level=level, **forms)["argmin"].item()
    # Half a step of the grid, and as much for the surplus: 1.040 of all current, 1.037 of that above 1 A.
    assert estimate == pytest.approx(expected, abs=0.01)


def test_the_printed_mean_winding_cannot_fit_a_heavy_short(study: pl.DataFrame) -> None:
    """It spreads one phase's short over all angles, so that current of the wrong shape is left over."""
    forms = {"fault": "short_a", "level": "high", "equivalent": "torque", "fitness": "least_squares"}
    least = {model: _rows(study, model=model, **forms)["least"].item() for model in MODELS}
    # For two thirds of the time, k is 0.65 of healthy, otherwise 1; the current goes with 1/k: a constant
    # between both has the error sqrt(2/9) (1/0.65 - 1) of 2.4 A rms, 0.6 A. The ripple leaves 0.1 A, 36
    # times less when squared; ten times less is required.
    assert least["monitor"] > 10 * max(least["averaged"], least["monitor, modulated"])


@pytest.mark.parametrize("distance", [-75, -50, -1, 0, 25, 51, 99])
def test_the_bias_of_a_phase_is_taken_along_the_shorter_arc(distance: int) -> None:
    angle = float(wrap(2 * np.pi * distance / 100))
    bias = 2 * np.pi * grid_distance("eccentricity_phase", distance) / 100
    # The same angle at both ends of the half turn, to the rounding of doubles.
    assert (np.cos(bias), np.sin(bias)) == pytest.approx((np.cos(angle), np.sin(angle)))
    assert abs(grid_distance("eccentricity_phase", distance)) <= 50
    assert grid_distance("gain", distance) == distance


def test_the_study_is_reproducible(study: pl.DataFrame, monkeypatch: pytest.MonkeyPatch) -> None:
    states = tuple(state for state in published.FITNESS if state.fault == "short_a")
    monkeypatch.setattr(published, "FITNESS", states)  # all of them take long
    assert fitness_study(ACTUATOR).equals(study.filter(pl.col("fault") == "short_a"))


def test_the_table_compares_with_the_thesis(study: pl.DataFrame) -> None:
    lines = fitness_table(study).splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert len({len(row) for row in cells}) == 1
    assert len(lines) == 2 + len(published.FITNESS)
    gain = next(row for row in cells if row[:2] == ["gain", "low"])
    assert gain[2:4] == ["7.9e-02", "1.27e+03"]


def test_a_misspelt_form_is_refused_with_the_nearest_name(study: pl.DataFrame) -> None:
    with pytest.raises(MethodError, match=r"unknown fitness 'thesys' \(did you mean 'thesis'\?\)"):
        fitness_table(study, "thesys")
    with pytest.raises(MethodError, match=r"unknown model 'average' \(did you mean 'averaged'\?\)"):
        draw_scans(study, "average")


def test_the_figure_marks_truth_and_minimum(study: pl.DataFrame) -> None:
    figure = draw_scans(study)
    figure.draw_without_rendering()  # raises if the figure cannot be laid out
    panels = {axis.get_title(loc="left"): axis for axis in figure.axes}
    assert set(panels) == set(study["fault"])
    assert all("[A²]" in axis.get_ylabel() for axis in figure.axes[::2])
    lines = panels["short_a"].get_lines()
    dots = {
        (to_hex(line.get_color()), float(np.atleast_1d(line.get_xdata())[0]))
        for line in lines
        if line.get_marker() == "o"
    }
    forms = {"fault": "short_a", "model": "averaged", "fitness": "least_squares"}
    assert dots == {
        (COLOURS[form], argmin)
        for level in ("low", "high")
        for form in COLOURS
        for argmin in _rows(study, level=level, equivalent=form, **forms)["argmin"]
    }
    assert {float(np.atleast_1d(line.get_xdata())[0]) for line in lines if line.get_color() == TRUTH} == {
        0.2,
        0.7,
    }
