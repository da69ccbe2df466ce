"""A load that varies while an actuator is recorded: found with the faults, and not taken for them."""

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
"""Where a load may rise with the position, by some 20 N·m/rad."""

CHANNELS = ("time_s", "command_rad", "current_A", "voltage_V")


def swinging(time: Any) -> Any:
    return 0.03 + 0.08 * np.sin(2 * np.pi * 3 * np.asarray(time))


def recorded(actuator: Actuator = THESIS, *, channels: tuple[str, ...] = CHANNELS) -> Recording:
    options: dict[str, Any] = {"duration": DURATION, "noise": 0.05, "adc_bits": 12, "seed": 4}
    whole = simulate(actuator, Chirp(duration=DURATION), faults=TRUTH, load=swinging, **options)
    return Recording({name: whole[name] for name in channels})


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    """Return what is found of a load that is asked for."""
    return diagnose(recorded(), WITH_HINGE, nuisances=(*USUAL, LOAD_VARIATION, "hinge"), workers=1)


# That a load that swings is selected is tested in parts in `test_load_steps.py`.
@pytest.mark.evidence
def test_faults_are_found_under_a_load_that_nobody_named() -> None:
    diagnosis = diagnose(recorded(), THESIS, workers=1)
    assert diagnosis.explained
    assert (diagnosis.selected, diagnosis.laws) == ((LOAD_VARIATION, "hinge"), ())
    assert all(covered(TRUTH.vector, diagnosis))
    degraded = {name for name, one in diagnosis.components.items() if one.verdict == "degraded"}
    assert degraded == {"friction", "short_a", "gain"}


def test_the_load_is_found_with_them(found: Diagnosis) -> None:
    load = found.load
    assert load is not None
    off = np.abs(load.value - swinging(found.time_s))
    # Of five recordings, the row that was farthest off was 1.8 to 2.9 standard errors off.
    assert np.max(off / load.standard_error) < 4
    assert off.max() < 5e-3
    hinge = found.nuisances["hinge"]
    assert abs(hinge.value) < 3 * hinge.standard_error < 3.0


def test_it_is_said_in_one_line_and_drawn(found: Diagnosis, tmp_path: Path) -> None:
    (line,) = [line for line in found.notes() if line.startswith("The load varies from ")]
    assert "load_Nm" in line
    assert not any("load_variation_" in line for line in found.notes())
    assert [axis.get_ylabel() for axis in draw_external_load(found).axes] == ["load [N·m]"]
    assert "load [N·m]" in [axis.get_ylabel() for axis in draw_diagnosis(found).axes]
    write_report(found, tmp_path / "report.html")
    assert "The load at the motor, which varies" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_a_constant_load_beyond_its_prior_is_called_constant() -> None:
    time = np.linspace(0.0, 0.5, 100)
    flat = LoadEstimate(0.2 + 1e-3 * np.sin(30 * time), np.full(100, 1e-3), "N·m")
    assert (flat.is_constant, str(flat)) == (True, "is +0.2 N·m throughout")
    steep = replace(flat, value=flat.value + 0.02 * time)
    assert (steep.is_constant, str(steep)) == (False, "varies from +0.2 to +0.211 N·m")


def test_a_load_that_is_recorded_is_known() -> None:
    diagnosis = diagnose(recorded(channels=(*CHANNELS, "load_Nm")), THESIS, workers=1)
    assert diagnosis.explained
    assert (diagnosis.selected, diagnosis.load) == ((), None)


def test_it_can_be_asked_for_and_a_load_that_rises_with_the_position() -> None:
    recording = recorded(with_lumped_parameters(THESIS, {"hinge": 10.0}))
    asked = diagnose(recording, WITH_HINGE, nuisances=(*USUAL, LOAD_VARIATION, "hinge"), workers=1)
    assert asked.explained
    assert asked.selected == ()
    assert all(covered(TRUTH.vector, asked))
    assert asked.load is not None
    assert np.abs(asked.load.value - swinging(asked.time_s)).max() < 5e-3
    hinge = asked.nuisances["hinge"]
    assert abs(hinge.value - 10.0) < 3 * hinge.standard_error < 3.0


def test_it_has_an_interval_to_a_sixteenth_of_a_second() -> None:
    def names(name: str, duration: float) -> tuple[str, ...]:
        return NuisanceSet.of(THESIS, (name,), (), duration=duration).names

    assert names(LOAD_VARIATION, 0.5) == tuple(f"load_variation_{i}" for i in range(1, 8 + 3 + 1))
    assert len(names(LOAD_VARIATION, 1.0)) == 16 + 3
    assert names("load_variation_3", 0.5) == names(LOAD_VARIATION, 0.5)
    assert NuisanceSet.of(THESIS, (LOAD_VARIATION,), ("load_Nm",)).names == ()


def test_the_standard_error_of_a_load_is_that_of_its_coefficients(found: Diagnosis) -> None:
    names = [name for name in found.coordinates if name == "load" or name.startswith(LOAD_VARIATION)]
    alone = {name: found.nuisances[name] for name in names}
    rows = np.asarray(DURATION / 1000 * np.arange(1000))
    load = estimated_load(alone, found.coordinates, np.eye(len(found.coordinates)), rows)
    assert load is not None
    # In the middle of an interval: 1/48 and 23/48 of the coefficients about it, and the constant.
    errors = [alone[name].standard_error for name in names]
    constant = errors.pop(names.index("load"))
    middle = (np.array([1, 23, 23, 1]) / 48) ** 2 @ np.array(errors[:4]) ** 2 + constant**2
    row = 125  # of 250 in the first of four intervals; its middle is half a row before
    assert load.standard_error[row] == pytest.approx(middle**0.5, rel=0.02)
