"""Friction of a shaft: selection of the friction laws of an actuator, and of the law at standstill."""

from collections.abc import Callable
from typing import Any

import numpy as np

from emaphm.simulation.engine.structure import Structure
from emaphm.simulation.laws.friction import directional, dry_level, speed_after
from emaphm.simulation.laws.load_friction import transmitted_friction
from emaphm.simulation.laws.presliding import speed_against_bristles
from emaphm.simulation.laws.select import select
from emaphm.simulation.laws.standstill import speed_against, speed_through_standstill
from emaphm.simulation.laws.stribeck import stribeck_factor


def bristles(structure: Structure) -> Callable[..., Any]:
    """Return a function of the state for the bristles' torque [N·m]: a tuple, empty without bristles."""
    return _bristle_torque if structure.presliding else _no_bristles


def _bristle_torque(s: Any) -> Any:
    return (s.bristles,)


def _no_bristles(s: Any) -> Any:  # noqa: ARG001
    return ()


def friction(structure: Structure) -> Callable[..., Any]:
    """Return the friction law; Borello's if the actuator has no optional friction law.

    The law is a function of parameters, speed [rad/s], the bristles' torque as from `bristles`, motor torque
    [N·m], external torque (which opposes positive motion) [N·m], viscous coefficient, static and dynamic
    friction, and step per inertia. It returns the speed after the step and the bristles' torque after it.
    """
    if not structure.smooth_friction:
        return _borello
    load, stribeck = structure.load_dependent, structure.stribeck
    unequal, quadratic = structure.directional, structure.quadratic
    through = _through_standstill(structure)

    def speed_of(
        p: Any,
        speed: Any,
        bristles: Any,
        torque: Any,
        external: Any,
        viscous: Any,
        static: Any,
        dynamic: Any,
        step_per_inertia: Any,
    ) -> Any:
        drag = viscous * speed
        if unequal:
            drag = drag * directional(speed, p.viscous_asymmetry)
        if quadratic:
            drag = drag + p.quadratic * speed * np.abs(speed)
        free = speed + (torque - external - drag) * step_per_inertia
        transmitted, at_low_speed = 0.0, 0.0
        if load:
            transmitted = transmitted_friction(torque, -external, p.load_motor, p.load_external)
            at_low_speed = transmitted_friction(
                torque, -external, p.stribeck_load_motor, p.stribeck_load_external
            )
        # Bristles do not stick: without a Stribeck speed their friction has no static level.
        factor = 0.0
        if stribeck or not structure.presliding:
            at = stribeck_factor(speed, p.inverse_stribeck) if stribeck else select(speed == 0.0, 1.0, 0.0)
            # A shaft that reverses passes standstill, where friction has its static level.
            factor = select(speed * free < 0.0, 1.0, at)
        level = dry_level(static, dynamic, transmitted, at_low_speed, factor)
        if unequal:
            level = level * directional(free, p.coulomb_asymmetry)
        return through(p, free, level * step_per_inertia, bristles, step_per_inertia)

    return speed_of


def _through_standstill(structure: Structure) -> Callable[..., Any]:
    """Return the law of dry friction at standstill.

    The law is a function of parameters, the speed after the step without dry friction, the change of speed by
    its full level in the step, the bristles' torque, and step per inertia.
    """
    if structure.presliding:
        return _against_bristles
    return _smoothly if structure.transition else _sticking


def _sticking(p: Any, free: Any, braking: Any, bristles: Any, step_per_inertia: Any) -> Any:  # noqa: ARG001
    return speed_against(free, braking), ()


def _smoothly(p: Any, free: Any, braking: Any, bristles: Any, step_per_inertia: Any) -> Any:  # noqa: ARG001
    return speed_through_standstill(free, braking, p.inverse_transition), ()


def _against_bristles(p: Any, free: Any, braking: Any, bristles: Any, step_per_inertia: Any) -> Any:
    (torque,) = bristles
    held, give = torque * step_per_inertia, p.bristle_stiffness * step_per_inertia
    after, holding = speed_against_bristles(free, braking, held, give, p.bristle_damping * step_per_inertia)
    return after, (holding / step_per_inertia,)


def _borello(
    p: Any,  # noqa: ARG001
    speed: Any,
    bristles: Any,  # noqa: ARG001
    torque: Any,
    external: Any,
    viscous: Any,
    static: Any,
    dynamic: Any,
    step_per_inertia: Any,
) -> Any:
    return speed_after(speed, torque - external - viscous * speed, static, dynamic, step_per_inertia), ()
