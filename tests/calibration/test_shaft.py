"""A compliant shaft is found by the reference model, where the averaged model does not show its swing."""

from dataclasses import replace

from cases import THESIS
from emaphm.actuator import Actuator, Chirp
from emaphm.actuator.law_sections import Transmission
from emaphm.calibration.campaign import campaign_rows
from emaphm.calibration.description import Description
from emaphm.calibration.shaft import with_shaft_that_shows
from emaphm.calibration.unit_fit import FitSettings
from emaphm.recording import Recording, acquire
from emaphm.simulated_recording import simulate

FREE = ("inertia", "viscous", "coulomb")
SETTINGS = FitSettings((), 2, 0, 1)
COMPLIANT = THESIS.model_copy(update={"transmission": Transmission(stiffness=985.6, damping=7.84e-3)})


def found(machine: Actuator, settings: FitSettings = SETTINGS) -> Description:
    whole = simulate(machine, Chirp(duration=0.15), model="reference", duration=0.15, seed=1)
    kept = {name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")}
    recording = acquire(Recording(kept, whole.sampling, "healthy"), noise={"current_A": 0.05}, seed=1)
    return with_shaft_that_shows(campaign_rows(recording), Description(THESIS, FREE), settings)


def test_a_shaft_that_gives_is_found_and_a_rigid_one_stays_rigid() -> None:
    compliant = found(COMPLIANT)
    assert [law.name for law in compliant.laws] == ["compliance"]
    assert compliant.free == (*FREE, "stiffness", "damping")
    assert compliant.actuator.transmission is not None
    assert "The shaft gives, by the reference model" in compliant.law_notes[0]
    rigid = found(THESIS)
    assert (rigid.laws, rigid.free, rigid.law_notes) == ((), FREE, ())
    assert rigid.actuator == THESIS


def test_nothing_is_asked_of_the_reference_model_where_corrections_are_turned_off() -> None:
    assert found(COMPLIANT, replace(SETTINGS, max_corrections=0)).laws == ()
