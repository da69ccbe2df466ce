"""The first look: it indicates deviations of inertia, supply and lag, and none of a unit as described."""

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.arrays import Array
from emaphm.diagnosis.selection.extension import with_nuisances
from emaphm.diagnosis.selection.first_look import FIRST_LOOK, FirstLook, first_look
from emaphm.estimation.bias_correction import with_discrepancy
from emaphm.estimation.objective import MapObjective, faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

FAULTS = Faults(0.3, 0.4, 0.0, 0.25, 0.1, 0.35, 0.7, 0.4)
LAG = LAWS["sensor-lag"].added_to(THESIS)
SHARE = 0.1


def with_deviation(**shares: float) -> Actuator:
    nominal = lumped_parameters(THESIS, tuple(shares))
    return with_lumped_parameters(
        THESIS, {name: (1 + share) * nominal[name] for name, share in shares.items()}
    )


def first_look_at(present: Actuator, described: Actuator = THESIS) -> FirstLook:
    """Return the first look at the true faults for a recording of the actuator `present`."""
    whole = simulate(present, Chirp(), faults=FAULTS, noise=0.05, adc_bits=12)
    recording = Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")})
    objective = faults_objective(problem_of(recording, described, workers=1), ("load",))
    point = objective.space.points(FAULTS.vector)
    result = with_discrepancy(SearchResult.at(objective, point), seed=0)
    return first_look(result, (), either_inertia(result), seed=0)


def either_inertia(result: SearchResult) -> tuple[MapObjective, Array]:
    objective, point = with_nuisances(result, (), ("inertia",))
    column = objective.space.coordinates.index("inertia")
    unit = float(objective.space.nuisances.meaning[-1, -1])
    points = np.tile(point, (2, 1))
    points[:, column] = np.array([-SHARE, SHARE]) / unit
    return objective, points


def test_an_accurately_known_supply_is_not_examined() -> None:
    nuisances = THESIS.nuisances.model_copy(update={"supply": 5e-3})
    look = first_look_at(THESIS, THESIS.model_copy(update={"nuisances": nuisances}))
    assert not look.shows_supply


@pytest.mark.parametrize(
    ("present", "shown"),
    [
        (THESIS, (False, False, False)),
        (with_deviation(inertia=SHARE), (True, None, None)),
        (with_deviation(supply=-SHARE), (None, True, None)),
        (with_lumped_parameters(LAG, {"current_lag": 1e-5}), (None, None, True)),
    ],
    ids=["as described", "inertia", "supply", "lag"],
)
def test_deviations_are_indicated(
    present: Actuator, shown: tuple[bool | None, bool | None, bool | None]
) -> None:
    look = first_look_at(present)
    indicated = (look.shows_inertia, look.shows_supply, look.shows_lag)
    # A deviation may cause an indication of another one, but a unit as described may not.
    assert all(expected is None or flag == expected for flag, expected in zip(indicated, shown, strict=True))


def test_the_residual_is_smaller_with_the_heavier_inertia() -> None:
    lighter, heavier = first_look_at(with_deviation(inertia=SHARE)).inertia
    assert heavier < 1 < FIRST_LOOK.inertia < lighter


def test_a_described_lag_is_indicated_without_runs() -> None:
    look = first_look_at(LAG, LAG)
    assert look.shows_inertia
    assert look.shows_supply
    assert look.shows_lag
