"""Reasons why an actuator cannot have an optional law."""

from collections.abc import Callable, Mapping

from emaphm.actuator.actuator import Actuator


def reason_against(name: str, actuator: Actuator) -> str:
    """Return the reason why `actuator` cannot have the law of that name, empty if it can."""
    return _REASONS.get(name, _no_reason)(actuator)


def _no_reason(actuator: Actuator) -> str:  # noqa: ARG001
    return ""


def _without_windings(actuator: Actuator) -> str:
    return "" if actuator.electrical is not None else "it has no [electrical] section"


def _without_trapezoid(actuator: Actuator) -> str:
    return (
        "" if actuator.commutates else "only the motor of a drive that commutates has a trapezoidal back-EMF"
    )


def _without_commutation(actuator: Actuator) -> str:
    return "" if actuator.commutates else "its drive does not commutate"


def _with_standstill_law(name: str) -> Callable[[Actuator], str]:
    def reason(actuator: Actuator) -> str:
        friction = actuator.friction
        is_given = friction is not None and getattr(friction, name) is not None
        return f"{name} already describes its friction at standstill" if is_given else ""

    return reason


_REASONS: Mapping[str, Callable[[Actuator], str]] = {
    "transition": _with_standstill_law("presliding_stiffness"),
    "presliding": _with_standstill_law("transition_speed"),
    "compliance": lambda actuator: (
        ""
        if actuator.mechanics.inertia_motor > 0 and actuator.mechanics.inertia_user > 0
        else "a shaft is between two inertias; give inertia_motor and inertia_user above 0"
    ),
    "gravity": lambda actuator: "a weight turns with a rotary actuator" if actuator.has_linear_user else "",
    "emf-flats": _without_trapezoid,
    "emf-sine": _without_trapezoid,
    "hall-angles": _without_commutation,
    "commutation-lag": _without_commutation,
    "sensor-lag": lambda actuator: "" if actuator.three_phases else "its drive senses no current",
    "viscous-temperature": lambda actuator: (
        ""
        if actuator.electrical is not None
        else "its nominal temperature is in [electrical], which it lacks"
    ),
    "winding-temperature": _without_windings,
    "source-resistance": _without_windings,
    "inverter-drop": _without_windings,
}
