"""Selection, by the reference model, of laws to which the averaged model is insensitive."""

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


def description_by(
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
def test_a_law_identified_by_the_reference_model_is_selected_only_if_it_exists(
    asked: Callable[..., Description], machine: Actuator, law: str, note: str
) -> None:
    with_law = description_by(asked, machine)
    assert [selected_law.name for selected_law in with_law.laws] == [law]
    assert with_law.free == (*FREE, *LAWS[law].parameters)
    assert LAWS[law].is_in(with_law.actuator)
    assert note in with_law.law_notes[0]
    without_law = description_by(asked, THESIS)
    assert (without_law.laws, without_law.free, without_law.law_notes) == ((), FREE, ())
    assert without_law.actuator == THESIS


def test_no_law_of_the_reference_model_is_selected_without_corrections() -> None:
    for asked, machine in ((with_shaft_that_shows, COMPLIANT), (with_lag_that_shows, LAGGING)):
        assert description_by(asked, machine, replace(SETTINGS, max_corrections=0)).laws == ()
