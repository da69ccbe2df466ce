"""A load that varies during a recording: estimated with the faults, which it does not bias."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cases import THESIS, USUAL, covered
from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.diagnosis.load_estimate import LoadEstimate, estimated_load
from emaphm.estimation.space.nuisances import LOAD_VARIATION, NuisanceSet
from emaphm.plotting.diagnosis import draw_diagnosis
from emaphm.plotting.external_load import draw_external_load
from emaphm.recording import Recording
from emaphm.report import write_report
from emaphm.simulated_recording import simulate

DURATION = 0.3
TRUTH = Faults(friction=0.2, short_a=0.1, gain=0.6)
WITH_HINGE = Actuator.from_dict(THESIS.model_dump() | {"nuisances": {"hinge": 20.0}})
"""An actuator whose load may be proportional to the position, with a prior of 20 N·m/rad."""

CHANNELS = ("time_s", "command_rad", "current_A", "voltage_V")


def oscillating_load(time: Any) -> Any:
    return 0.03 + 0.08 * np.sin(2 * np.pi * 3 * np.asarray(time))


def recorded(
    actuator: Actuator = THESIS, *, channels: tuple[str, ...] = CHANNELS, duration: float = DURATION
) -> Recording:
    options: dict[str, Any] = {"duration": duration, "noise": 0.05, "adc_bits": 12, "seed": 4}
    whole = simulate(actuator, Chirp(duration=duration), faults=TRUTH, load=oscillating_load, **options)
    return Recording({name: whole[name] for name in channels})


@pytest.fixture(scope="module")
def diagnosis() -> Diagnosis:
    """Return the diagnosis with a requested varying load."""
    return diagnose(recorded(), WITH_HINGE, nuisances=(*USUAL, LOAD_VARIATION, "hinge"), workers=1)


# `test_load_steps.py` tests parts of the selection of an oscillating load.
@pytest.mark.evidence
def test_faults_are_estimated_under_an_unnamed_varying_load() -> None:
    diagnosis = diagnose(recorded(), THESIS, workers=1)
    assert diagnosis.explained
    assert (diagnosis.selected, diagnosis.laws) == ((LOAD_VARIATION, "hinge"), ())
    assert all(covered(TRUTH.vector, diagnosis))
    degraded = {name for name, one in diagnosis.components.items() if one.verdict == "degraded"}
    assert degraded == {"friction", "short_a", "gain"}


def test_the_varying_load_is_estimated(diagnosis: Diagnosis) -> None:
    load = diagnosis.load
    assert load is not None
    error = np.abs(load.value - oscillating_load(diagnosis.time_s))
    # In five recordings, the largest deviation of a row was 1.8 to 2.9 standard errors.
    assert np.max(error / load.standard_error) < 4
    assert error.max() < 5e-3
    hinge = diagnosis.nuisances["hinge"]
    assert abs(hinge.value) < 3 * hinge.standard_error < 3.0


def test_the_load_is_reported_in_one_line_and_drawn(diagnosis: Diagnosis, tmp_path: Path) -> None:
    (line,) = [line for line in diagnosis.notes() if line.startswith("The load varies from ")]
    assert "load_Nm" in line
    assert not any("load_variation_" in line for line in diagnosis.notes())
    assert [axis.get_ylabel() for axis in draw_external_load(diagnosis).axes] == ["load [N·m]"]
    assert "load [N·m]" in [axis.get_ylabel() for axis in draw_diagnosis(diagnosis).axes]
    write_report(diagnosis, tmp_path / "report.html")
    assert "The load at the motor, which varies" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_a_constant_load_beyond_its_prior_is_reported_as_constant() -> None:
    time = np.linspace(0.0, 0.5, 100)
    flat = LoadEstimate(0.2 + 1e-3 * np.sin(30 * time), np.full(100, 1e-3), "N·m")
    assert (flat.is_constant, str(flat)) == (True, "is +0.2 N·m throughout")
    steep = replace(flat, value=flat.value + 0.02 * time)
    assert (steep.is_constant, str(steep)) == (False, "varies from +0.2 to +0.211 N·m")


def test_a_recorded_load_is_known() -> None:
    diagnosis = diagnose(recorded(channels=(*CHANNELS, "load_Nm"), duration=0.2), THESIS, workers=1)
    assert diagnosis.explained
    assert (diagnosis.selected, diagnosis.load) == ((), None)


def test_a_varying_load_and_a_hinge_can_be_requested() -> None:
    recording = recorded(with_lumped_parameters(THESIS, {"hinge": 10.0}))
    diagnosis = diagnose(recording, WITH_HINGE, nuisances=(*USUAL, LOAD_VARIATION, "hinge"), workers=1)
    assert diagnosis.explained
    assert diagnosis.selected == ()
    assert all(covered(TRUTH.vector, diagnosis))
    assert diagnosis.load is not None
    assert np.abs(diagnosis.load.value - oscillating_load(diagnosis.time_s)).max() < 5e-3
    hinge = diagnosis.nuisances["hinge"]
    assert abs(hinge.value - 10.0) < 3 * hinge.standard_error < 3.0


def test_a_varying_load_has_an_interval_per_sixteenth_of_a_second() -> None:
    def names(name: str, duration: float) -> tuple[str, ...]:
        return NuisanceSet.of(THESIS, (name,), (), duration=duration).names

    assert names(LOAD_VARIATION, 0.5) == tuple(f"load_variation_{i}" for i in range(1, 8 + 3 + 1))
    assert len(names(LOAD_VARIATION, 1.0)) == 16 + 3
    assert names("load_variation_3", 0.5) == names(LOAD_VARIATION, 0.5)
    assert NuisanceSet.of(THESIS, (LOAD_VARIATION,), ("load_Nm",)).names == ()


def test_the_standard_error_of_a_load_follows_from_its_coefficients(diagnosis: Diagnosis) -> None:
    names = [name for name in diagnosis.coordinates if name == "load" or name.startswith(LOAD_VARIATION)]
    alone = {name: diagnosis.nuisances[name] for name in names}
    rows = np.asarray(DURATION / 1000 * np.arange(1000))
    load = estimated_load(alone, diagnosis.coordinates, np.eye(len(diagnosis.coordinates)), rows)
    assert load is not None
    # In the middle of an interval: weights 1/48 and 23/48 of the nearest coefficients, and the constant.
    errors = [alone[name].standard_error for name in names]
    constant = errors.pop(names.index("load"))
    middle = (np.array([1, 23, 23, 1]) / 48) ** 2 @ np.array(errors[:4]) ** 2 + constant**2
    row = 125  # of 250 rows in the first of four intervals, whose middle is half a row earlier
    assert load.standard_error[row] == pytest.approx(middle**0.5, rel=0.02)
