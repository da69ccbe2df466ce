"""Unusable recordings are refused with the place and the remedy."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emaphm.recording import Recording
from emaphm.recording.checks import check

from .conftest import Columns, Refusal


def _without(*names: str) -> Callable[[Columns], Columns]:
    return lambda columns: {name: values for name, values in columns.items() if name not in names}


def _with_value(name: str, row: int, value: float) -> Callable[[Columns], Columns]:
    def change(columns: Columns) -> Columns:
        changed = columns[name].copy()
        changed[row - 1] = value
        return {**columns, name: changed}

    return change


def _late_from(row: int, by: float) -> Callable[[Columns], Columns]:
    def change(columns: Columns) -> Columns:
        time = columns["time_s"].copy()
        time[row - 1 :] += by
        return {**columns, "time_s": time}

    return change


def _with_jitter(largest: float) -> Callable[[Columns], Columns]:
    """Move every time stamp by up to `largest`, as a fraction of the interval."""

    def change(columns: Columns) -> Columns:
        moves = np.random.default_rng(0).uniform(-largest, largest, columns["time_s"].size)
        return {**columns, "time_s": columns["time_s"] + 2e-4 * moves}

    return change


def _first_rows(rows: int) -> Callable[[Columns], Columns]:
    return lambda columns: {name: values[:rows] for name, values in columns.items()}


NO_RESPONSE = ("current_A", "position_rad", "speed_rad_s")


def _phases_instead(*phases: str) -> Callable[[Columns], Columns]:
    def change(columns: Columns) -> Columns:
        without_responses = _without(*NO_RESPONSE)(columns)
        return {**without_responses, **dict.fromkeys(phases, columns["current_A"])}

    return change


BAD = {
    "no time": (_without("time_s"), ["'time_s' is missing", "a recording needs"]),
    "no command": (_without("command_rad"), ["'command_rad' is missing"]),
    "no response": (
        _without(*NO_RESPONSE),
        ["'current_A' is missing", "three phase currents", "position_rad", "duty"],
    ),
    "two phases": (
        _phases_instead("current_a_A", "current_b_A", "angle_rad"),
        ["'current_c_A' is missing"],
    ),
    "no angle": (
        _phases_instead("current_a_A", "current_b_A", "current_c_A"),
        ["'angle_rad' is missing"],
    ),
    "short column": (
        lambda columns: {**columns, "current_A": columns["current_A"][:-1]},
        ["'current_A' has 2499 rows", "'time_s' has 2500", "same length"],
    ),
    "matrix": (
        lambda columns: {**columns, "current_A": columns["current_A"][:, None]},
        ["'current_A'", "(2500, 1)", "one value a row"],
    ),
    "too short": (_first_rows(49), ["49 rows", "at least 50", "longer"]),
    "not a number": (_with_value("current_A", 17, np.nan), ["row 17", "'current_A'", "correct", "header"]),
    "infinite": (
        _with_value("temperature_K", 1, np.inf),
        ["row 1 ", "'temperature_K'", "cut the recording"],
    ),
    "time repeated": (_late_from(300, -2e-4), ["row 300 ", "'time_s'", "does not increase", "sort"]),
    "absurd time": (
        lambda columns: {**columns, "time_s": np.r_[-1.7e308, 1.7e308, columns["time_s"][2:]]},
        ["row 3 ", "does not increase"],
    ),
    "gap": (_late_from(1200, 0.5), ["row 1200 ", "'time_s'", "0.5002 s", "0.0002 s", "resample"]),
    "lost row": (_late_from(1200, 2e-4), ["row 1200 ", "not uniform", "0.0004 s"]),
    "no clock to speak of": (_with_jitter(0.45), ["not uniform", "'time_s'", "resample"]),
    "nothing commanded": (
        lambda columns: {**columns, "command_rad": 0 * columns["command_rad"]},
        ["nothing was commanded", "'command_rad'", "must move"],
    ),
}


@pytest.mark.parametrize(("change", "expected"), BAD.values(), ids=BAD.keys())
def test_bad_recording_is_refused(
    columns: Columns, refusal: Refusal, change: Callable[[Columns], Columns], expected: list[str]
) -> None:
    Recording(columns)  # valid before the change
    text = refusal(lambda: Recording(change(columns), source="rig 3"))
    assert text.startswith("rig 3: ")
    for part in expected:
        assert part in text


def test_a_gap_is_reported_at_its_row_even_if_longer_than_the_recording(
    columns: Columns, refusal: Refusal
) -> None:
    assert "row 1200 " in refusal(lambda: Recording(_late_from(1200, 1e6)(columns)))


def test_errors_use_the_names_of_the_file(columns: Columns, refusal: Refusal) -> None:
    bad = _with_value("current_A", 17, np.nan)(columns)
    assert "'vir' (current_A)" in refusal(lambda: check(bad, "rig.mat", {"current_A": "vir"}))


@pytest.mark.parametrize(
    "name",
    ["current_A", "voltage_V", "position_rad", "speed_rad_s", "duty", "current_q_A", "voltage_d_V"],
)
def test_one_measured_response_is_enough(columns: Columns, name: str) -> None:
    selected = {"time_s": columns["time_s"], "command_rad": columns["command_rad"]}
    assert Recording({**selected, name: columns["current_A"]}).names == ("time_s", "command_rad", name)


@pytest.mark.parametrize("rows", [50, 51])
def test_fifty_rows_are_enough(columns: Columns, rows: int) -> None:
    assert Recording(_first_rows(rows)(columns)).samples == rows


def test_a_constant_nonzero_command_is_a_step(columns: Columns) -> None:
    check({**columns, "command_rad": np.full(2500, 5e-3)}, "rig 3")


def test_columns_outside_the_schema_may_have_missing_values(columns: Columns) -> None:
    holes = np.full(2500, np.nan)
    assert "humidity" in Recording({**columns, "humidity": holes})


@given(st.integers(0, 2**32 - 1), st.floats(-1e3, 1e3), st.floats(1e-6, 1e-2))
def test_clock_jitter_below_half_a_percent_counts_as_uniform(
    seed: int, start: float, interval: float
) -> None:
    # Time stamps with errors up to 0.4 % of the interval give steps with errors up to 0.8 %, under the limit
    # of 1 %; the margin covers the rounding of a start far from 0.
    stamps = np.arange(200) + 0.004 * np.random.default_rng(seed).uniform(-1, 1, 200)
    ones = np.ones(200)
    check({"time_s": start + interval * stamps, "command_rad": ones, "current_A": ones}, "rig 3")
