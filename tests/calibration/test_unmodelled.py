"""Unmodelled laws: warnings of a calibration on few manoeuvres, and widened standard errors."""

import pytest

from emaphm.actuator import Actuator, Chirp, Command, Sine
from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.calibration import Calibration, calibrate
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

DC = Actuator.dc()
LOADED = with_lumped_parameters(DC, {"hinge": 0.5})
"""A machine with an undescribed load: a spring."""

CHIRP, SLOW = Chirp(duration=0.5), Sine(2e-2, 2.0)


def calibrated(unit: Actuator, *commands: Command, noise: float = 0.02) -> Calibration:
    days = []
    for seed, command in enumerate(commands):
        whole = simulate(unit, command, model="averaged", noise=noise, duration=0.5, seed=seed)
        columns = {name: whole[name] for name in ("time_s", "command_rad", "current_A", "position_rad")}
        days.append(Recording(columns, whole.sampling, f"day {seed}"))
    return calibrate(days, DC, ("inertia", "viscous"), nuisances=(), max_corrections=0, workers=1)


@pytest.fixture(scope="module")
def chirp() -> Calibration:
    return calibrated(LOADED, CHIRP)


@pytest.fixture(scope="module")
def slow() -> Calibration:
    return calibrated(LOADED, SLOW)


def warnings_on_few_manoeuvres(calibration: Calibration) -> list[str]:
    return [warning for warning in calibration.warnings if "that is no noise" in warning]


def test_one_manoeuvre_with_a_structured_residual_has_a_warning(
    chirp: Calibration, slow: Calibration
) -> None:
    # The truth is outside the 95 % interval by the chirp.
    inertia, true = chirp.parameters["inertia"], lumped_parameters(DC, ("inertia",))["inertia"]
    assert abs(inertia.value - true) > 2 * inertia.standard_error
    for calibration in (chirp, slow):
        (warning,) = warnings_on_few_manoeuvres(calibration)
        assert "of current_A that is no noise, and one manoeuvre cannot show" in warning


def test_contradicting_manoeuvres_need_no_such_warning() -> None:
    calibration = calibrated(LOADED, CHIRP, SLOW)
    assert calibration.scattered
    assert warnings_on_few_manoeuvres(calibration) == []


@pytest.mark.parametrize("commands", [(CHIRP,), (CHIRP, CHIRP)])
def test_a_complete_model_has_no_warning(commands: tuple[Command, ...]) -> None:
    assert calibrated(DC, *commands).warnings == ()


def test_a_residual_beyond_the_limit_of_a_diagnosis_has_a_warning(
    chirp: Calibration, slow: Calibration
) -> None:
    assert not any("diagnosis allows" in message for message in chirp.warnings)
    (warning,) = [message for message in slow.warnings if "diagnosis allows" in message]
    share = slow.relative_error["current_A"]
    assert share > 0.05
    assert warning.startswith(
        f"day 0: the residual is {100 * share:.3g} % of current_A, more than noise and the 5 %"
    )


STICKING = with_lumped_parameters(
    LAWS["stribeck"].added_to(DC, 50.0),
    {"static": 1.6 * DC.mechanics.dynamic_friction, "stribeck_speed": 5.0},
)


def warnings_on_a_law(calibration: Calibration) -> list[str]:
    return [warning for warning in calibration.warnings if "lacks a law" in warning]


def test_a_missing_law_has_a_warning_with_the_residual() -> None:
    calibration = calibrated(STICKING, CHIRP, SLOW)
    (warning,) = warnings_on_a_law(calibration)
    assert warning.startswith("in 2 of 2 recordings, the residual is up to ")
    assert "times what noise and switching explain" in warning
    assert "--laws auto" in warning
    assert f"{100 * calibration.relative_error['current_A']:.2g} % of current_A" in warning
    ratios = [recording["residual_over_noise"] for recording in calibration.to_dict()["recordings"]]
    assert f"up to {max(ratios):.2g} times" in warning


@pytest.mark.parametrize("seed", range(6))
def test_a_description_with_all_laws_has_no_such_warning(seed: int) -> None:
    noise = (0.005, 0.02, 0.1)[seed % 3]
    whole = simulate(STICKING, (CHIRP, SLOW)[seed % 2], model="averaged", noise=noise, seed=seed)
    columns = {name: whole[name] for name in ("time_s", "command_rad", "current_A")}
    calibration = calibrate(
        Recording(columns, whole.sampling, "day"),
        STICKING,
        ("inertia", "coulomb"),
        nuisances=(),
        max_corrections=0,
        workers=1,
    )
    assert warnings_on_a_law(calibration) == []


def test_the_residual_of_a_missing_law_widens_the_standard_errors() -> None:
    without, with_law = (
        calibrate(
            Recording(
                {name: whole[name] for name in ("time_s", "command_rad", "current_A")}, whole.sampling, "day"
            ),
            described,
            ("inertia", "coulomb"),
            nuisances=(),
            max_corrections=0,
            workers=1,
        ).parameters["coulomb"]
        for whole in [simulate(STICKING, CHIRP, model="averaged", noise=0.02)]
        for described in (DC, STICKING)
    )
    true = DC.mechanics.dynamic_friction
    assert abs(with_law.value - true) < 3 * with_law.standard_error
    # Coulomb friction compensates the missing law, by many of the standard errors by noise.
    assert abs(without.value - true) > 10 * with_law.standard_error
    assert abs(without.value - true) < 4 * without.standard_error
