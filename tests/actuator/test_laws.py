"""The catalogue of optional laws: each law can be added, written and read, or is refused."""

from functools import reduce
from pathlib import Path
from typing import Any

import pytest

from emaphm.actuator import Actuator
from emaphm.actuator.actuator import described_parts
from emaphm.actuator.laws import LAWS, law_named, laws_of
from emaphm.actuator.unit.baseline import LUMPED_PARAMETERS
from emaphm.errors import ActuatorError, MethodError
from emaphm.simulation.engine.plant import structure_of
from emaphm.simulation.engine.structure import Structure

THESIS = Actuator.thesis()
LINEAR = Actuator.from_dict(THESIS.model_dump() | {"coordinates": "linear"})
EACH_LAW = pytest.mark.parametrize("name", LAWS)


def changed(**sections: dict[str, Any] | None) -> Actuator:
    values = THESIS.model_dump()
    for name, keys in sections.items():
        values[name] = None if keys is None else (values[name] or {}) | keys
    return Actuator.from_dict(values)


@EACH_LAW
def test_a_law_can_be_added_to_the_thesis_actuator(name: str) -> None:
    law = law_named(name)
    assert not law.is_in(THESIS)
    assert not law.reason_against(THESIS)
    within = law.added_to(THESIS, 50.0)
    assert law.is_in(within)
    assert set(laws_of(within)) == {name, *law.needs}
    assert laws_of(THESIS) == ()


@EACH_LAW
def test_a_law_adds_its_parameters(name: str) -> None:
    law = law_named(name)
    within = law.added_to(THESIS)
    described = [parameter for parameter in law.parameters if described_parts(within, parameter) is not None]
    # A ripple may have more harmonics than its default.
    assert described == list(law.parameters)[: len(described)]
    assert len(described) >= min(len(law.parameters), 4)
    assert set(law.also_free) <= set(LUMPED_PARAMETERS)
    assert law.excited_by


@pytest.mark.parametrize(
    ("pole_pairs", "orders"),
    [
        (1, [1, 2, 6, 12]),
        (2, [1, 2, 4, 12, 24]),
        (5, [1, 2, 5, 10, 30, 60]),
        (21, [1, 2, 21, 42, 126]),
        (300, [1, 2]),
    ],
)
def test_cogging_has_the_orders_of_the_turn_the_electrical_turn_and_the_slots(
    pole_pairs: int, orders: list[int]
) -> None:
    actuator = changed(electrical={"pole_pairs": pole_pairs})
    assert [harmonic.order for harmonic in law_named("cogging").added_to(actuator).ripple] == orders


@EACH_LAW
def test_an_existing_law_is_not_added_again(name: str) -> None:
    within = law_named(name).added_to(THESIS, 50.0)
    assert law_named(name).added_to(within, 80.0) == within


@EACH_LAW
def test_an_actuator_with_a_law_is_read_back_unchanged(name: str, tmp_path: Path) -> None:
    within = law_named(name).added_to(THESIS)
    path = tmp_path / "actuator.toml"
    within.to_toml(path)
    assert Actuator.from_toml(path) == within


@pytest.mark.parametrize("without", ["transition", "presliding"])
def test_an_actuator_with_all_laws_is_read_back_unchanged(without: str, tmp_path: Path) -> None:
    # Both laws define friction at standstill and exclude each other.
    laws = {name: law for name, law in LAWS.items() if name != without}
    within = reduce(lambda actuator, law: law.added_to(actuator), laws.values(), THESIS)
    assert laws_of(within) == tuple(laws)
    path = tmp_path / "actuator.toml"
    within.to_toml(path)
    assert Actuator.from_toml(path) == within


IN_ITS_KERNEL = {
    "load-dependent": {"load_dependent"},
    "load-split": {"load_dependent"},
    "stribeck": {"stribeck"},
    "stribeck-load": {"stribeck", "load_dependent"},
    "directional": {"directional"},
    "quadratic": {"quadratic"},
    "transition": {"transition"},
    "presliding": {"presliding", "stribeck"},
    "viscous-temperature": set[str](),  # a recording's temperature sets its viscous friction, before any run
    "compliance": {"compliance"},
    "gravity": {"gravity"},
    "cogging": {"ripples"},
    "command-lag": {"position_pid"},  # it delays the signal that this controller follows
    "speed-lag": set[str](),  # every speed loop has it, with a time constant of 0
    "speed-integral": set[str](),  # likewise, with a gain of 0
    "position-integral": {"position_pid"},
    "feedforward": {"position_pid"},
    "winding-temperature": set[str](),  # likewise its resistance and torque constant
    "saturation": {"saturation"},
    "emf-flats": {"emf_shape"},
    "emf-sine": {"emf_shape"},
    "hall-angles": {"commutation"},
    "commutation-lag": {"commutation"},
    "sensor-lag": {"current_lag"},
    "source-resistance": {"source"},
    "inverter-drop": {"voltage_drop"},
}


@EACH_LAW
def test_a_law_changes_only_its_own_part_of_the_kernel(name: str) -> None:
    plain, within = Structure()._asdict(), structure_of(law_named(name).added_to(THESIS))._asdict()
    assert structure_of(THESIS) == Structure()
    assert {key for key in plain if plain[key] != within[key]} == IN_ITS_KERNEL[name]


@pytest.mark.parametrize(
    ("name", "actuator", "reason"),
    [
        ("compliance", changed(mechanics={"inertia_user": 0.0}), "a shaft is between two inertias"),
        ("presliding", changed(friction={"transition_speed": 1.0}), "transition_speed already describes"),
        (
            "transition",
            changed(friction={"presliding_stiffness": 1.0}),
            "presliding_stiffness already describes",
        ),
        ("gravity", LINEAR, "a weight turns with a rotary actuator"),
        ("sensor-lag", changed(drive={"kind": "voltage"}), "its drive senses no current"),
        ("sensor-lag", changed(electrical=None), "its drive senses no current"),
        ("emf-flats", changed(drive={"kind": "voltage"}), "has a trapezoidal back-EMF"),
        ("emf-sine", changed(electrical=None), "has a trapezoidal back-EMF"),
        ("hall-angles", changed(drive={"kind": "voltage"}), "its drive does not commutate"),
        ("winding-temperature", changed(electrical=None), r"it has no \[electrical\] section"),
        ("source-resistance", changed(electrical=None), r"it has no \[electrical\] section"),
        ("inverter-drop", changed(electrical=None), r"it has no \[electrical\] section"),
    ],
)
def test_a_law_that_an_actuator_cannot_have_is_refused(name: str, actuator: Actuator, reason: str) -> None:
    with pytest.raises(MethodError, match=f"actuator 'thesis' cannot have law '{name}': .*{reason}"):
        law_named(name).added_to(actuator)


def test_an_unknown_law_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(MethodError, match=r"unknown law 'stribek' \(did you mean 'stribeck'\?\)"):
        law_named("stribek")


@pytest.mark.parametrize(
    ("sections", "complaint"),
    [
        ({"friction": {"stribeck_load_motor": 0.1}}, "give stribeck_speed too"),
        ({"friction": {"presliding_damping": 0.1}}, "give presliding_stiffness too"),
        ({"friction": {"presliding_stiffness": 1.0, "transition_speed": 1.0}}, "at standstill: give one"),
        ({"friction": {"load_motor": 1.0}}, "'friction.load_motor': should be less than 1"),
        (
            {"friction": {"coulomb_asymmetry": -1.0}},
            "'friction.coulomb_asymmetry': should be greater than -1",
        ),
        ({"friction": {"stribeck_speed": 0.0}}, "'friction.stribeck_speed': should be greater than 0"),
        ({"friction": {"stribek_speed": 1.0}}, "unknown key 'friction.stribek_speed' (did you mean"),
        ({"transmission": {"stiffness": -5.0}}, "'transmission.stiffness': should be greater than 0"),
        ({"transmission": {"damping": 0.1}}, "key 'transmission.stiffness' is missing"),
        (
            {"transmission": {"stiffness": 5.0}, "mechanics": {"inertia_user": 0.0}},
            "[transmission] joins two inertias",
        ),
        ({"drive": {"kind": "current"}}, "has an ideal current loop; take out [electrical]"),
        ({"drive": {"kind": "voltage", "current_lag": 1e-5}}, "senses no current; take it out"),
        ({"drive": {"kind": "voltage"}, "electrical": None}, "needs an [electrical] section; add it"),
        (
            {"drive": {"kind": "hysteresis"}, "electrical": {"hysteresis": None}},
            "'electrical.hysteresis' is missing",
        ),
        ({"drive": {"kind": "six-step"}}, "needs current_gain; add it"),
        ({"drive": {"kind": "sixstep"}}, "'drive.kind': should be 'hysteresis'"),
    ],
)
def test_a_contradictory_description_is_refused_in_one_line(
    sections: dict[str, dict[str, Any] | None], complaint: str
) -> None:
    with pytest.raises(ActuatorError) as caught:
        changed(**sections)
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)
