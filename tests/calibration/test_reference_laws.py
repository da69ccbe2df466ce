"""Where laws are chosen, the reference model finds those that the averaged model hardly shows."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp
from emaphm.actuator.law_sections import Transmission
from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.calibration.campaign import campaign_rows
from emaphm.calibration.description import Description
from emaphm.calibration.reference_laws.sensor_lag import with_lag_that_shows
from emaphm.calibration.reference_laws.shaft import with_shaft_that_shows
from emaphm.calibration.unit_fit import FitSettings
from emaphm.recording import Recording, acquire
from emaphm.simulated_recording import simulate

FREE = ("inertia", "viscous", "coulomb")
SETTINGS = FitSettings((), 2, 0, 1)
COMPLIANT = THESIS.model_copy(update={"transmission": Transmission(stiffness=985.6, damping=7.84e-3)})
LAGGING = with_lumped_parameters(LAWS["sensor-lag"].added_to(THESIS), {"current_lag": 2e-5})


def found(
    asked: Callable[..., Description], machine: Actuator, settings: FitSettings = SETTINGS
) -> Description:
    whole = simulate(machine, Chirp(duration=0.15), model="reference", duration=0.15, seed=1)
    kept = {name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")}
    recording = acquire(Recording(kept, whole.sampling, "healthy"), noise={"current_A": 0.05}, seed=1)
    return asked(campaign_rows(recording), Description(THESIS, FREE), settings)


@pytest.mark.parametrize(
    ("asked", "machine", "law", "note"),
    [
        (with_shaft_that_shows, COMPLIANT, "compliance", "The shaft is compliant, by the reference model"),
        (with_lag_that_shows, LAGGING, "sensor-lag", "The current sensors lag, by the reference model"),
    ],
)
def test_a_law_that_the_reference_model_shows_is_taken_and_none_that_is_missing(
    asked: Callable[..., Description], machine: Actuator, law: str, note: str
) -> None:
    there = found(asked, machine)
    assert [one.name for one in there.laws] == [law]
    assert there.free == (*FREE, *LAWS[law].parameters)
    assert LAWS[law].is_in(there.actuator)
    assert note in there.law_notes[0]
    missing = found(asked, THESIS)
    assert (missing.laws, missing.free, missing.law_notes) == ((), FREE, ())
    assert missing.actuator == THESIS


def test_nothing_is_asked_of_the_reference_model_where_corrections_are_turned_off() -> None:
    for asked, machine in ((with_shaft_that_shows, COMPLIANT), (with_lag_that_shows, LAGGING)):
        assert found(asked, machine, replace(SETTINGS, max_corrections=0)).laws == ()
