"""Selection of nuisances: identifiable deviations are selected, and none for an actuator as described."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from cases import THESIS, drawn
from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.diagnosis import Diagnosis, diagnose, error_percent
from emaphm.diagnosis.selection.nuisance_candidates import gross_scale_starts
from emaphm.diagnosis.selection.rivals import with_rivals
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.nuisances import NO_NUISANCES
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate
from emaphm.simulation.engine import running

pytestmark = pytest.mark.usefixtures("one_search", "unrefined")

SHOWN = ("time_s", "command_rad", "current_A", "voltage_V")
FAULTS = [Faults(), Faults.from_vector(drawn(1, seed=5)[0])]


def recorded(actuator: Actuator, faults: Faults, seed: int = 0) -> Recording:
    command = Chirp(duration=0.2)
    whole = simulate(actuator, command, faults=faults, duration=0.2, noise=0.05, adc_bits=12, seed=seed)
    return Recording({name: whole[name] for name in SHOWN})


def heavier(share: float) -> Actuator:
    inertia = lumped_parameters(THESIS, ("inertia",))["inertia"]
    return with_lumped_parameters(THESIS, {"inertia": (1 + share) * inertia})


@pytest.fixture(scope="module")
def of_heavy() -> tuple[Recording, Diagnosis]:
    """Return a recording of faults with ten percent more inertia than described, and its diagnosis."""
    recording = recorded(heavier(0.1), FAULTS[1], 1)
    with pytest.MonkeyPatch.context() as patched:
        # Threads are forced for this short recording: two groups of actuators are already distributed.
        patched.setattr(running, "WORTH_A_THREAD", 1)
        return recording, diagnose(recording, THESIS, workers=2)


def test_a_deviation_of_inertia_of_ten_percent_is_selected(of_heavy: tuple[Recording, Diagnosis]) -> None:
    _, diagnosis = of_heavy
    assert diagnosis.selected == ("inertia",)
    inertia = diagnosis.nuisances["inertia"]
    assert abs(inertia.value - 0.1) <= 4 * inertia.standard_error
    assert "deviates significantly from the description: inertia" in str(diagnosis)
    assert "inertia" in diagnosis.to_dict()["suspected"]


def test_a_deviation_of_inertia_taken_as_known_biases_the_faults(
    of_heavy: tuple[Recording, Diagnosis],
) -> None:
    recording, with_inertia = of_heavy
    taken_as_known = diagnose(recording, THESIS, nuisances=("load", "temperature"))
    assert taken_as_known.selected == ()
    before, after = (
        error_percent(FAULTS[1].vector, diagnosis.faults.vector)
        for diagnosis in (taken_as_known, with_inertia)
    )
    assert after <= before / 4


@pytest.mark.parametrize("case", range(len(FAULTS)))
def test_nothing_is_suspected_of_the_actuator_as_described(case: int) -> None:
    diagnosis = diagnose(recorded(THESIS, FAULTS[case], case), THESIS)
    assert (diagnosis.selected, diagnosis.laws, diagnosis.sensor_faults) == ((), (), ())
    assert tuple(diagnosis.nuisances) == THESIS.nuisances.estimated


def test_a_small_deviation_usual_in_every_actuator_is_not_selected() -> None:
    # Without noise on four channels, a scale error of 0.001 is larger than the standard errors.
    whole = simulate(THESIS, Chirp(duration=0.2), duration=0.2)
    assert diagnose(whole, THESIS).selected == ()


def test_an_offset_of_the_current_sensors_is_selected() -> None:
    whole = recorded(THESIS, FAULTS[1])
    columns = {name: whole[name] + 0.1 if name == "current_A" else whole[name] for name in whole}
    diagnosis = diagnose(Recording(columns), THESIS)
    assert diagnosis.selected == ("current_offset",)
    assert diagnosis.nuisances["current_offset"].value == pytest.approx(0.1, abs=0.03)


def test_a_nuisance_that_is_not_identifiable_is_not_selected() -> None:
    # With the current alone, inertia is confounded with friction and shorts.
    whole = recorded(heavier(0.1), FAULTS[1])
    alone = Recording({name: whole[name] for name in SHOWN[:3]})
    assert "inertia" not in diagnose(alone, THESIS).selected


def test_the_selection_does_not_depend_on_the_number_of_threads(
    of_heavy: tuple[Recording, Diagnosis],
) -> None:
    recording, with_two_threads = of_heavy
    with_one_thread = diagnose(recording, THESIS, workers=1)
    assert with_one_thread.selected == with_two_threads.selected == ("inertia",)
    np.testing.assert_array_equal(with_one_thread.covariance, with_two_threads.covariance)
    assert with_one_thread.faults == with_two_threads.faults


@pytest.mark.evidence
def test_of_equal_explanations_the_more_probable_inertia_is_selected() -> None:
    # Five percent are one standard deviation of the prior of inertia, and five of the voltage scale's.
    diagnosis = diagnose(recorded(heavier(0.05), Faults(), 2), THESIS, seed=2)
    assert diagnosis.selected == ("inertia",)
    assert diagnosis.nuisances["inertia"].value == pytest.approx(0.05, abs=0.01)
    assert diagnosis.components["friction"].value == pytest.approx(0.0, abs=0.01)


def space_of(*names: str) -> ParameterSpace:
    zeros, ones = np.zeros(len(names)), np.ones(len(names))
    return ParameterSpace(zeros, ones, tuple(map(CARTESIAN_NAMES.index, names)), {}, NO_NUISANCES)


def test_rivals_add_covariance_by_their_probability() -> None:
    objective = SimpleNamespace(space=space_of("friction", "gain"))
    lacking = SimpleNamespace(space=space_of("gain"))
    best = SearchResult.at(cast("Any", objective), np.array([0.3, 0.5]), correction=np.zeros(1))
    others = [
        SearchResult.at(cast("Any", objective), np.array([0.5, 0.5]), correction=np.zeros(1)),
        SearchResult.at(cast("Any", lacking), np.array([0.4]), correction=np.zeros(1)),
    ]
    added = with_rivals(best, others, np.array([0.0, 2 * np.log(4)])).scatter - best.scatter
    # Relative probabilities of 1, 1 and 1/4; friction, not estimated in the second rival, is nominal there.
    first, second = np.array([0.2, 0.0]), np.array([-0.3, -0.1])
    expected = (np.outer(first, first) + np.outer(second, second) / 4) / 2.25
    np.testing.assert_allclose(added, expected, atol=1e-12)


@pytest.mark.parametrize("tolerances", [{}, {"tolerances": {"torque_constant": 0.1, "resistance": 0.05}}])
@pytest.mark.parametrize("factor", [-1.0, 1.5])
def test_the_start_for_a_grossly_wrong_scale_is_its_size(factor: float, tolerances: dict[str, Any]) -> None:
    healthy = recorded(THESIS, Faults())
    wrong = healthy.with_channels({**healthy.channels, "voltage_V": factor * healthy["voltage_V"]}, [])
    described = Actuator.from_dict(THESIS.model_dump(exclude_none=True) | tolerances)
    objective = faults_objective(problem_of(wrong, described, channels=SHOWN[2:]), ("load",))
    result = SearchResult.at(objective, objective.space.points(Faults().vector[np.newaxis])[0])
    (_, extended, point) = gross_scale_starts(result, (), ("voltage_scale",))["voltage_scale"]
    scale = extended.space.nuisance_values(point[np.newaxis])["voltage_scale"].item()
    assert scale == pytest.approx(factor - 1, abs=0.03)  # the averaged voltage has no ripple
