"""Laws are chosen by the error in recordings left out of the fit, and their parameters found."""

from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp, Command
from emaphm.actuator.laws import LAWS, Law
from emaphm.actuator.laws.calibrated import laws_to_calibrate
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.calibration import Calibration, calibrate, description, law_selection
from emaphm.calibration.unit_fit import FitSettings
from emaphm.errors import MethodError
from emaphm.recording import Recording, acquire
from emaphm.simulated_recording import simulate

pytestmark = pytest.mark.usefixtures("no_model_error")

FREE = ("inertia", "viscous", "coulomb")
STRIBECK = with_lumped_parameters(
    LAWS["stribeck"].added_to(THESIS, 60.0),
    {"inertia": 2.7e-5, "coulomb": 0.075, "static": 0.14, "stribeck_speed": 20.0},
)
COMMANDS: tuple[Command, ...] = (Chirp(duration=0.2), Chirp(stop_hz=8.0, duration=0.2))


def recordings_of(actuator: Actuator) -> list[Recording]:
    days = []
    for seed, command in enumerate(COMMANDS):
        whole = simulate(actuator, command, model="averaged", duration=0.2)
        kept = {name: whole[name] for name in ("time_s", "command_rad", "current_A", "position_rad")}
        noise = {"current_A": 0.05, "position_rad": 2e-5}
        days.append(acquire(Recording(kept, whole.sampling, f"day {seed}"), noise=noise, seed=seed))
    return days


@pytest.fixture
def few_laws(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave two laws to choose from: each, and each pair, has kernels of its own to compile."""
    few = (LAWS["stribeck"], LAWS["directional"])
    monkeypatch.setattr(description, "laws_to_calibrate", lambda _: few)


def calibrated(
    actuator: Actuator, laws: str | list[str], free: tuple[str, ...] | None = FREE, *, days: int = 2
) -> Calibration:
    recordings = recordings_of(actuator)[:days]
    return calibrate(recordings, THESIS, free, laws=laws, nuisances=(), max_corrections=0, workers=1)


@pytest.mark.usefixtures("few_laws")
def test_the_law_that_a_machine_has_is_chosen_and_no_other() -> None:
    found = calibrated(STRIBECK, "auto")
    assert found.laws == ("stribeck",)
    assert found.parameters["stribeck_speed"].value == pytest.approx(20.0, rel=0.05)
    assert found.parameters["static"].value == pytest.approx(0.14, rel=0.02)
    assert found.parameters["coulomb"].value == pytest.approx(0.075, rel=0.02)
    assert found.actuator.friction is not None
    assert found.actuator.friction.stribeck_speed == found.parameters["stribeck_speed"].value
    trials = found.to_dict()["selection"]
    assert [one["law"] for one in trials[:3]] == ["none", "stribeck", "directional"]
    assert [one["law"] for one in trials if one["chosen"]] == ["none", "stribeck"]
    none, stribeck = trials[0], next(one for one in trials if one["law"] == "stribeck")
    assert stribeck["held_out_error"] < 0.5 * none["held_out_error"]
    # Held-out data are no easier than those of the fit.
    assert none["held_out_error"] >= 0.99 * none["training_error"]
    assert all(one["seconds"] > 0 and one["evaluations"] > 0 for one in trials)
    assert "stribeck + directional" in str(found)


@pytest.mark.usefixtures("few_laws")
def test_a_machine_without_further_laws_gets_none() -> None:
    found = calibrated(with_lumped_parameters(THESIS, {"inertia": 2.7e-5, "coulomb": 0.075}), "auto")
    assert found.laws == ()
    assert found.parameters["inertia"].value == pytest.approx(2.7e-5, rel=0.01)
    assert found.actuator.friction == THESIS.friction


def test_bristles_are_tried_with_the_stribeck_speed_that_they_need(monkeypatch: pytest.MonkeyPatch) -> None:
    # Soft bristles: a Stribeck speed alone gains 1 %, less than what is asked of a law.
    few = (LAWS["stribeck"], LAWS["presliding"])
    monkeypatch.setattr(description, "laws_to_calibrate", lambda _: few)
    bristles = with_lumped_parameters(
        LAWS["presliding"].added_to(THESIS, 60.0),
        {"stribeck_speed": 2.0, "presliding_stiffness": 0.84, "presliding_damping": 2e-3},
    )
    found = calibrated(bristles, "auto")
    assert found.laws == ("stribeck", "presliding")
    assert found.parameters["presliding_stiffness"].value == pytest.approx(0.84, rel=0.05)
    # A machine without bristles gets none with it: they must be worth more than the speed alone.
    assert calibrated(STRIBECK, "auto").laws == ("stribeck",)


def chosen_of(
    errors: Mapping[tuple[str, ...], float], candidates: Sequence[str], monkeypatch: pytest.MonkeyPatch
) -> list[str]:
    """Return the laws that are chosen where the errors by laws are known; a third law changes nothing."""

    class Table(law_selection._Trials):
        """Fits whose errors are known, about the same of four recordings; a third law changes nothing."""

        def fit(self, names: tuple[str, ...]) -> Any:
            logs = np.log(errors.get(names, errors[names[:2]])) + 1e-3 * np.arange(4) * len(names)
            return law_selection._Fit(THESIS, names, self.base.joint, np.zeros(len(names)), logs, logs)

        def described(self, *_: object) -> Any:
            return self.fit(())

        def cross_validated(self, fitted: Any) -> Any:
            return fitted

        def with_law(self, current: Any, law: Law, _: float) -> Any:
            return self.fit((*current.free, law.name))

    monkeypatch.setattr(law_selection, "_Trials", Table)
    monkeypatch.setattr(law_selection, "typical_motor_speed", lambda _: 60.0)
    laws = [LAWS[name] for name in candidates]
    base: Any = SimpleNamespace(joint=None)
    rows: Any = range(4)
    choice = law_selection.select_laws(rows, base, THESIS, (), laws, FitSettings((), 0, 0, 1))
    return [law.name for law in choice.laws]


@pytest.mark.parametrize(
    ("with_compliance", "with_cogging", "expected"),
    [
        (0.87, 0.87, ["presliding", "compliance"]),
        (0.89, 0.87, ["presliding"]),
        (0.87, 0.84, ["presliding", "cogging"]),
    ],
)
def test_a_law_that_was_worth_it_before_another_came_is_kept(
    monkeypatch: pytest.MonkeyPatch, with_compliance: float, with_cogging: float, expected: list[str]
) -> None:
    errors = {
        (): 1.0,
        ("presliding",): 0.88,
        ("compliance",): 0.92,
        ("cogging",): 0.995,
        ("presliding", "compliance"): with_compliance,
        ("presliding", "cogging"): with_cogging,
    }

    assert chosen_of(errors, ("presliding", "compliance", "cogging"), monkeypatch) == expected


def test_a_law_that_helps_only_while_another_is_missing_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    # Nearly every law gains a few percent while the one that the machine has is missing.
    errors = {(): 1.0, ("stribeck",): 0.35, ("quadratic",): 0.96, ("stribeck", "quadratic"): 0.3485}
    assert chosen_of(errors, ("stribeck", "quadratic"), monkeypatch) == ["stribeck"]


def test_named_laws_are_added_and_the_usual_parameters_are_free() -> None:
    found = calibrated(STRIBECK, ["stribeck"], None, days=1)
    assert {*FREE, "stribeck_speed", "static"} <= set(found.parameters)
    assert found.parameters["stribeck_speed"].value == pytest.approx(20.0, rel=0.05)
    assert (found.laws, found.selection) == (("stribeck",), ())


def test_a_law_that_is_not_determined_is_named_with_its_manoeuvre() -> None:
    # Without a load that changes and at one temperature, heat has no effect to be seen.
    found = calibrated(THESIS, ["viscous-temperature"])
    assert found.unexcited == {"viscous-temperature": LAWS["viscous-temperature"].excited_by}
    assert not found.parameters["viscous_temperature"].identifiable
    assert "These recordings do not determine the law 'viscous-temperature'; recordings at" in str(found)


def test_what_cannot_be_chosen_is_refused() -> None:
    days = recordings_of(THESIS)
    with pytest.raises(MethodError, match="two recordings at least; add one of another manoeuvre, or name"):
        calibrate(days[0], THESIS, FREE, laws="auto")
    with pytest.raises(MethodError, match=r"unknown law 'stribek' \(did you mean 'stribeck'\?\)"):
        calibrate(days, THESIS, FREE, laws=["stribek"])
    with pytest.raises(MethodError, match=r"no parameter to calibrate; name some of .*, or laws to add"):
        calibrate(days, THESIS)
    with pytest.raises(MethodError, match=r"'hall_a' of law 'hall-angles' cannot be calibrated: phases that"):
        calibrate(days, THESIS, FREE, laws=["hall-angles"])
    assert LAWS["hall-angles"] not in laws_to_calibrate(THESIS)
    assert LAWS["cogging"] in laws_to_calibrate(THESIS)
