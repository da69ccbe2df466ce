"""The verb `design`: printed and written results, and refusals."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from emaphm.actuator import NAMES
from emaphm.version import VERSION

from .conftest import Emaphm, Refusal
from .test_verbs import EMPS, parsed

SOON = ("--candidates", "0", "--tests", "0")
"""Only the given manoeuvre and its expected intervals."""

SHORT = ("--duration", "0.2", "--sample-rate", "500")

SMALL = ("--actuator", EMPS, "--frequency", "3", *SHORT, "--candidates", "2", "--tests", "4")
"""A search that takes one second, because the actuator has no windings."""

PROMISED = {
    "given",
    "found",
    "better",
    "gain",
    "proven_by",
    "candidates",
    "tests",
    "channels",
    "noise_A",
    "sample_rate_hz",
    "actuator",
    "seed",
    "version",
}


def test_design_reports_the_precision_of_the_thesis_chirp(emaphm: Emaphm) -> None:
    answer = parsed(emaphm, "design", *SOON, "--seed", "4")
    assert answer.keys() == PROMISED
    assert (answer["actuator"], answer["seed"], answer["version"]) == ("thesis", 4, VERSION)
    assert answer["found"] == answer["given"]
    assert (answer["better"], answer["gain"], answer["proven_by"]) == (False, None, None)
    manoeuvre = answer["given"]["manoeuvre"]
    assert [manoeuvre[name] for name in ("command", "amplitude", "start_hz", "stop_hz", "duration_s")] == [
        "chirp",
        5e-3,
        0.0,
        15.0,
        0.5,
    ]
    assert answer["given"]["expected"].keys() == set(NAMES)
    assert all(0 < half < 0.25 for half in answer["given"]["expected"].values())


def test_design_searches_a_manoeuvre_and_tests_it(emaphm: Emaphm) -> None:
    answer = parsed(emaphm, "design", *SMALL)
    assert (answer["candidates"], answer["tests"], answer["proven_by"]) == (2, 4, "averaged")
    for plan in (answer["given"], answer["found"]):
        assert plan["expected"].keys() == plan["proven"].keys() == {"friction", "gain"}
        assert plan["median_error_percent"] > 0


def test_design_prints_a_table(emaphm: Emaphm, desk: Path) -> None:
    code, out, err = emaphm("design", *SOON, "--channels", "current,voltage", "--figure", "plan.png")
    assert (code, err) == (0, "")
    for piece in (*NAMES, "given: chirp of 0.005 rad, 0 to 15 Hz, 0.5 s", "given, predicted", "voltage_V"):
        assert piece in out
    assert (desk / "plan.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("command", [("--command", "chirp"), ("--command", "sine"), ("--command", "step")])
def test_simulate_plays_the_command_that_design_wrote(
    emaphm: Emaphm, desk: Path, command: tuple[str, ...]
) -> None:
    code, out, _ = emaphm("design", *SOON, *command, "--out", "plan.csv")
    assert code == 0
    assert "Command written to plan.csv; it lasts 0.5 s." in out
    assert emaphm("simulate", "file.csv", "--command", "plan.csv", "--model", "averaged").code == 0
    assert emaphm("simulate", "named.csv", *command, "--model", "averaged").code == 0
    first, second = (pl.read_csv(desk / name) for name in ("file.csv", "named.csv"))
    # Linear interpolation between rows at 5 kHz deviates by (2 pi 15 Hz × 0.2 ms)² / 8 of the amplitude.
    np.testing.assert_allclose(first["command_rad"], second["command_rad"], atol=5e-5 * 5e-3)


@pytest.mark.usefixtures("desk")
def test_a_file_may_be_the_given_command(emaphm: Emaphm) -> None:
    by_name = parsed(emaphm, "design", *SOON, "--out", "plan.csv")["given"]
    by_file = parsed(emaphm, "design", *SOON, "--command", "plan.csv")["given"]
    assert by_file["manoeuvre"]["command"] == "command from a file"
    for name, half in by_name["expected"].items():
        # The kinks of stick-slip move with the last digits of a command: this alone changes a width by up
        # to a fifth, as observed with amplitudes that differ by the interpolation error between rows.
        assert by_file["expected"][name] == pytest.approx(half, rel=0.5)


BAD = {
    "design --command bogus": ("unknown command 'bogus'", "chirp"),
    "design --command step": ("no highest frequency", "--max-frequency"),
    "design --channels current,speeed": ("'speeed'", "did you mean 'speed'?"),
    "design --channels voltage": ("current",),
    "design --noise 0": ("noise of 0 A", "more than 0"),
    "design --noise 1e300": ("--noise 1e+300 A", "current limit of 22.5 A"),
    "design --sample-rate 1e300": ("5e+299 rows", "a lower --sample-rate"),
    "design --sample-rate 1e6 --max-duration 2": ("2e+06 rows", "200,000 are possible"),
    "design --candidates 100000000": ("--candidates 100000000", "10,000 or fewer"),
    "design --tests 100000000": ("--tests 100000000", "1,000 or fewer"),
    "design --max-amplitude 0.001": ("largest amplitude", "0.005 is more than 0.001"),
    "design --max-duration 0": ("largest duration of 0",),
    "design --max-frequency nan": ("largest frequency of nan",),
    "design --tests 0": ("--candidates 0", "--tests"),
    "design --tests 1": ("too few simulated tests",),
    "design --candidates -3": ("-3 candidates",),
    "design --duration 0": ("--duration 0",),
    "design --seed -1": ("--seed -1",),
    "design --out good.csv": ("good.csv", "--force"),
    "design --out plan.parquet": ("plan.parquet", ".csv"),
    "design --figure plan.csv": ("plan.csv", ".png"),
    "design --actuator missing.toml": ("missing.toml",),
    "design plan.csv": ("plan.csv",),
}


@pytest.mark.parametrize("line", BAD)
def test_invalid_arguments_are_refused(refused: Refusal, line: str) -> None:
    message = refused(*line.split())
    for piece in BAD[line]:
        assert piece in message
