"""A load that varies while an actuator is recorded: found with the faults, and not taken for them."""

from typing import Any

import numpy as np
import pytest

from cases import THESIS, USUAL, covered
from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.diagnosis.varying_load import estimated_load
from emaphm.estimation.nuisances import LOAD_VARIATION, NuisanceSet
from emaphm.plotting.diagnosis import draw_diagnosis
from emaphm.plotting.external_load import draw_external_load
from emaphm.recording import Recording
from emaphm.report import write_report
from emaphm.simulated_recording import simulate

DURATION = 0.3
TRUTH = Faults(friction=0.2, short_a=0.1, gain=0.6)
CHANNELS = ("time_s", "command_rad", "current_A", "voltage_V")


def swinging(time: Any) -> Any:
    return 0.03 + 0.08 * np.sin(2 * np.pi * 3 * np.asarray(time))


def recorded(actuator: Actuator = THESIS, *, channels: tuple[str, ...] = CHANNELS) -> Recording:
    options: dict[str, Any] = {"duration": DURATION, "noise": 0.05, "adc_bits": 12, "seed": 4}
    whole = simulate(actuator, Chirp(duration=DURATION), faults=TRUTH, load=swinging, **options)
    return Recording({name: whole[name] for name in channels})


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    """What is found of a load that swings and rises with the position, and that nobody named."""
    return diagnose(recorded(with_lumped_parameters(THESIS, {"hinge": 10.0})), THESIS, workers=1)


def test_faults_are_found_under_a_load_that_nobody_named(found: Diagnosis) -> None:
    assert found.explained
    assert (found.selected, found.laws) == ((LOAD_VARIATION, "hinge"), ())
    assert all(covered(TRUTH.vector, found))
    degraded = {name for name, one in found.components.items() if one.verdict == "degraded"}
    assert degraded == {"friction", "short_a", "gain"}


def test_the_load_is_found_with_them(found: Diagnosis) -> None:
    load = found.load
    assert load is not None
    off = np.abs(load.value - swinging(found.time_s)) / load.standard_error
    assert np.mean(off < 2) > 0.9
    assert load.standard_error.max() < 0.02
    hinge = found.nuisances["hinge"]
    assert abs(hinge.value - 10.0) < 3 * hinge.standard_error < 5.0


def test_it_is_said_in_one_line_and_drawn(found: Diagnosis, tmp_path: Any) -> None:
    (line,) = [line for line in found.notes() if line.startswith("The load varies over the recording, from ")]
    assert "load_Nm" in line
    assert not any("load_variation_" in line for line in found.notes())
    assert [axis.get_ylabel() for axis in draw_external_load(found).axes] == ["load [N·m]"]
    assert "load [N·m]" in [
        axis.get_ylabel() for figure in draw_diagnosis(found).subfigs for axis in figure.axes
    ]
    write_report(found, tmp_path / "report.html")
    assert "The load at the motor, which varies" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_a_load_that_is_recorded_is_known() -> None:
    found = diagnose(recorded(channels=(*CHANNELS, "load_Nm")), THESIS, workers=1)
    assert found.explained
    assert (found.selected, found.load) == ((), None)


def test_it_can_be_asked_for(found: Diagnosis) -> None:
    asked = diagnose(recorded(), THESIS, nuisances=(*USUAL, LOAD_VARIATION), workers=1)
    assert asked.explained
    assert asked.selected == ()
    assert asked.load is not None
    assert all(covered(TRUTH.vector, asked))
    # A sixteenth of a second to an interval: 0.3 s have four.
    assert sum(name.startswith(LOAD_VARIATION) for name in asked.nuisances) == 7
    one_of_them = NuisanceSet.of(THESIS, ("load_variation_3",), (), duration=DURATION)
    assert one_of_them == NuisanceSet.of(THESIS, (LOAD_VARIATION,), (), duration=DURATION) or (
        one_of_them.names == NuisanceSet.of(THESIS, (LOAD_VARIATION,), (), duration=DURATION).names
    )


def test_the_standard_error_of_a_load_is_that_of_its_coefficients(found: Diagnosis) -> None:
    names = [name for name in found.coordinates if name == "load" or name.startswith(LOAD_VARIATION)]
    alone = {name: found.nuisances[name] for name in names}
    independent = np.diag(np.ones(len(found.coordinates)))
    load = estimated_load(alone, found.coordinates, independent, 1000)
    assert load is not None
    # In the middle of an interval: 1/48 and 23/48 of the coefficients about it, and the constant.
    errors = [alone[name].standard_error for name in names]
    constant, rest = (
        errors[names.index("load")],
        [e for n, e in zip(names, errors, strict=True) if n != "load"],
    )
    middle = (np.array([1, 23, 23, 1]) / 48) ** 2 @ np.array(rest[:4]) ** 2 + constant**2
    row = 125  # of 250 in the first of four intervals; its middle is half a row before
    assert load.standard_error[row] == pytest.approx(middle**0.5, rel=0.02)
