"""Motion of all models: from the motor's torque to speeds, angles and directions."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.simulation.engine.model import Initial
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.engine.structure import Structure
from emaphm.simulation.laws.angles import turn, wrap, wrap_once
from emaphm.simulation.laws.backlash import follow
from emaphm.simulation.laws.cogging import harmonic, ripple_torque
from emaphm.simulation.laws.compliant_shaft import shaft_torque
from emaphm.simulation.laws.gravity import gravity_load
from emaphm.simulation.laws.lag import approach, share_of_step
from emaphm.simulation.laws.load_steps import step_load, step_names
from emaphm.simulation.laws.load_variation import coefficient_names
from emaphm.simulation.laws.select import clip, select
from emaphm.simulation.models import friction

BEYOND_STOP = 0.1
"""Largest start position beyond an end stop that is attributed to a sensor error [rad at the motor]."""

STIFFEST = 2.0
"""Largest (ω Δt)² of the oscillation of a shaft between its inertias [-]: with `MOST_DAMPED` the steps are
stable. The stiffness of a stiffer shaft is reduced to this limit. At 50 µs the limit is an oscillation at
4.5 kHz, which no recording distinguishes from a rigid shaft."""

MOST_DAMPED = 0.9
"""Largest relative change of a shaft's relative speed in a step by its damping [-]."""

SLOWEST_STRIBECK = 1e-6
"""Least Stribeck or transition speed [rad/s]: at this speed, friction is practically a step at rest."""


def state_names(structure: Structure) -> tuple[str, ...]:
    """Return the names of the state of the motion."""
    return (
        "speed",
        "angle",
        "output",
        "electrical",
        "cos",
        "sin",
        *(("user_speed",) if structure.compliance else ()),
        *(("bristles",) if structure.presliding else ()),
        *(("user_cos", "user_sin") if structure.gravity else ()),
        *(("screw_cos", "screw_sin") if any(ripple.screw for ripple in structure.ripples) else ()),
    )


@cache
def parameter_names(structure: Structure) -> tuple[str, ...]:
    """Return the names of the parameters of the motion."""
    ripples = range(1, len(structure.ripples) + 1)
    harmonics = (f"ripple{i}_{part}" for i in ripples for part in ("cos", "sin"))
    steps = (name for i in range(1, structure.load_steps + 1) for name in step_names(i))
    return (*PARAMETERS, *harmonics, *coefficient_names(structure.load_variation), *steps)


PARAMETERS = (
    "torque_share",
    "gear_ratio",
    "torque_limit",
    "offset",
    "load_stiffness",
    "viscous",
    "static",
    "coulomb",
    "half_gap",
    "low_stop",
    "high_stop",
    "step_per_inertia",
    "pole_pairs",
    "inverse_stribeck",
    "inverse_transition",
    "bristle_stiffness",
    "bristle_damping",
    "load_motor",
    "load_external",
    "stribeck_load_motor",
    "stribeck_load_external",
    "coulomb_asymmetry",
    "viscous_asymmetry",
    "quadratic",
    "stiffness",
    "damping",
    "motor_step_per_inertia",
    "user_step_per_inertia",
    "user_viscous",
    "user_static",
    "user_coulomb",
    "gravity_along",
    "gravity_across",
    "screw_ratio",
)


NEUTRAL = {"torque_share": 1.0, "load_stiffness": 0.0}
"""No lag from current to torque, and no load proportional to the position."""


def parameters(plant: Plant, step: float) -> dict[str, Array]:
    """Return the parameters of the motion, (n,) each."""
    structure = plant.structure
    rows = {
        "torque_share": share_of_step(plant.torque_lag, step),
        "gear_ratio": plant.gear_ratio,
        "torque_limit": plant.torque_limit,
        "offset": plant.offset,
        "load_stiffness": plant.hinge * plant.gear_ratio,
        "viscous": plant.viscous,
        "static": plant.static,
        "coulomb": plant.coulomb,
        "half_gap": plant.backlash / 2,
        "low_stop": plant.low_stop,
        "high_stop": plant.high_stop,
        "step_per_inertia": step / plant.inertia,
        "pole_pairs": plant.pole_pairs,
    }
    zero = np.zeros(plant.count)
    if structure.smooth_friction:
        rows |= {
            "inverse_stribeck": 1 / np.maximum(plant.stribeck_speed, SLOWEST_STRIBECK),
            "bristle_stiffness": plant.presliding_stiffness * step,
            "bristle_damping": plant.presliding_damping,
            "inverse_transition": 1 / np.maximum(plant.transition_speed, SLOWEST_STRIBECK),
            "load_motor": plant.load_friction + plant.load_motor,
            "load_external": plant.load_friction + plant.load_external,
            "stribeck_load_motor": plant.stribeck_load_motor,
            "stribeck_load_external": plant.stribeck_load_external,
            "coulomb_asymmetry": plant.coulomb_asymmetry,
            "viscous_asymmetry": plant.viscous_asymmetry,
            "quadratic": plant.quadratic,
        }
    if structure.compliance:
        of_user = plant.user_share_of_inertia * plant.inertia
        reduced = plant.user_share_of_inertia * (plant.inertia - of_user)
        # On each side, dynamic friction must not exceed static friction, as for the sum (`engine.plant`).
        user_coulomb = plant.user_share_of_coulomb * plant.coulomb
        user_static = np.maximum(plant.user_share_of_static * plant.static, user_coulomb)
        of_motor = (1 - plant.user_share_of_static) * plant.static
        motor_static = np.maximum(of_motor, plant.coulomb - user_coulomb)
        rows |= {
            "stiffness": np.minimum(plant.stiffness, STIFFEST * reduced / step**2),
            "damping": np.minimum(plant.damping, MOST_DAMPED * reduced / step),
            "motor_step_per_inertia": step / (plant.inertia - of_user),
            "user_step_per_inertia": step / of_user,
            "user_viscous": plant.user_share_of_viscous * plant.viscous,
            "static": user_static + motor_static,
            "user_static": user_static,
            "user_coulomb": user_coulomb,
        }
    if structure.gravity:
        rows |= {
            "gravity_along": plant.gravity * np.cos(plant.gravity_angle),
            "gravity_across": plant.gravity * np.sin(plant.gravity_angle),
        }
    rows |= {"screw_ratio": plant.screw_ratio}
    for i in range(len(structure.ripples)):
        rows[f"ripple{i + 1}_cos"], rows[f"ripple{i + 1}_sin"] = plant.ripples[2 * i : 2 * i + 2]
    rows |= dict(zip(coefficient_names(structure.load_variation), plant.load_variation, strict=True))
    for i, step_of_load in enumerate(plant.load_steps, 1):
        rows |= dict(zip(step_names(i), step_of_load, strict=True))
    return dict.fromkeys(parameter_names(structure), zero) | rows


def motor_angle(plant: Plant, start: Initial) -> Array:
    """Return the motor's angle at `start`, (n,) [rad]: `start.angle` plus `gap` times half the backlash."""
    return np.asarray(start.angle + start.gap * plant.backlash / 2)


def rotor_angle(plant: Plant, start: Initial) -> Array:
    """Return the rotor's mechanical angle at `start`, (n,) [rad]; its electrical angle is 0 at 0."""
    return motor_angle(plant, start) + start.rotor_offset + plant.rotor_zero / plant.pole_pairs


def initial_state(plant: Plant, start: Initial) -> dict[str, Array]:
    """Return the state of the motion at `start`, (n,) each.

    Raises
    ------
    MethodError
        The start position is beyond the end stops.
    """
    beyond = np.maximum(start.angle - plant.high_stop, plant.low_stop - start.angle) - plant.backlash / 2
    if np.any(beyond > BEYOND_STOP):
        raise MethodError(
            f"the run starts at {start.angle * plant.gear_ratio[0]:.4g}, beyond the actuator's end stops; "
            "correct end_stops or the position"
        )
    rotor = rotor_angle(plant, start)
    one = np.ones(plant.count)
    user, screw = plant.gear_ratio * start.angle, plant.screw_ratio * rotor
    return {
        "speed": one * start.speed,
        "angle": motor_angle(plant, start),
        "output": one * start.angle,
        "electrical": wrap(plant.pole_pairs * rotor),
        "cos": np.cos(rotor),
        "sin": np.sin(rotor),
        "user_speed": one * start.speed,
        "bristles": np.zeros(plant.count),
        "user_cos": np.cos(user),
        "user_sin": np.sin(user),
        "screw_cos": np.cos(screw),
        "screw_sin": np.sin(screw),
    }


def motion(structure: Structure) -> Callable[..., Any]:
    """Return the law of the motion: a function of (state, parameters, inputs, motor torque).

    It returns the next state of the motion. An optional fifth argument is the amplitude of the torque ripple
    within a step, which helps a shaft at rest to break away.
    """
    ripple = _ripple(structure)
    move = _compliant(structure) if structure.compliance else _rigid(structure)
    weight, turn_user = (_weight, _turn_user) if structure.gravity else (_zero_torque, _no_state)
    stepping = _load_steps(structure.load_steps)
    turn_screw = _turn_screw if any(ripple.screw for ripple in structure.ripples) else _no_state

    def moved(s: Any, p: Any, u: Any, torque: Any, swing: Any = None) -> Any:
        external = u.load + p.offset + p.load_stiffness * s.output + weight(s, p) + stepping(p, u)
        speed, angle, output, user = move(s, p, u.step, torque + ripple(s, p), external, swing)
        turned = angle - s.angle
        cos, sin = turn(s.cos, s.sin, turned)
        electrical = wrap_once(s.electrical + p.pole_pairs * turned)
        rotor = (speed, angle, output, electrical, cos, sin)
        return rotor + user + turn_user(s, p, output - s.output) + turn_screw(s, p, turned)

    return moved


def driven_motion(structure: Structure) -> Callable[..., Any]:
    """Return the law of torque and motion: a function of (state, parameters, inputs, torque of the currents).

    It returns the motor's torque after the step, with its limit and its lag, and the next state of the
    motion. An optional fifth argument is the amplitude of the torque ripple, as in `motion`.
    """
    moved = motion(structure)

    def driven(s: Any, p: Any, u: Any, made: Any, swing: Any = None) -> Any:
        torque = approach(s.torque, clip(made, -p.torque_limit, p.torque_limit), p.torque_share)
        return torque, moved(s, p, u, torque, swing)

    return driven


def recorded_motion(s: Any, p: Any, u: Any, following: Any) -> Any:
    """Return the recorded position of the user, and speed and angle of the motor.

    They are those at the end of the step, or at its start, according to `u.carried`.
    """
    return (
        p.gear_ratio * (s.output + u.carried * (following[2] - s.output)),
        s.speed + u.carried * (following[0] - s.speed),
        s.angle + u.carried * (following[1] - s.angle),
    )


def _no_state(s: Any, p: Any, turned: Any) -> Any:  # noqa: ARG001
    return ()


def _zero_torque(s: Any, p: Any) -> Any:  # noqa: ARG001
    return 0.0


def _weight(s: Any, p: Any) -> Any:
    return gravity_load(s.user_cos, s.user_sin, p.gravity_along, p.gravity_across)


def _load_steps(count: int) -> Callable[..., Any]:
    """Return the sum of `count` load steps, as a function of parameters and inputs."""
    names_by_step = [step_names(i) for i in range(1, count + 1)]

    def stepping(p: Any, u: Any) -> Any:
        middle = u.time + u.step / 2
        return sum(
            step_load(getattr(p, size), getattr(p, instant), getattr(p, rise), middle, u.step)
            for size, instant, rise in names_by_step
        )

    return stepping


def _turn_user(s: Any, p: Any, turned: Any) -> Any:
    return turn(s.user_cos, s.user_sin, p.gear_ratio * turned)


def _turn_screw(s: Any, p: Any, turned: Any) -> Any:
    return turn(s.screw_cos, s.screw_sin, p.screw_ratio * turned)


def _ripple(structure: Structure) -> Callable[..., Any]:
    """Return the sum of the torque's harmonics, as a function of state and parameters."""
    total: Callable[..., Any] = _zero_torque
    for i, ripple in enumerate(structure.ripples, 1):
        total = _with_harmonic(total, harmonic(ripple.order), i, ripple.screw)
    return total


def _with_harmonic(
    before: Callable[..., Any], of_order: Callable[..., Any], i: int, screw: bool
) -> Callable[..., Any]:
    along, across = f"ripple{i}_cos", f"ripple{i}_sin"

    def total(s: Any, p: Any) -> Any:
        cos, sin = of_order(s.screw_cos, s.screw_sin) if screw else of_order(s.cos, s.sin)
        return before(s, p) + ripple_torque(cos, sin, getattr(p, along), getattr(p, across))

    return total


def _torque_at_breakaway(s: Any, torque: Any, opposing: Any, swing: Any) -> Any:
    """Return the motor's torque; at rest, plus the ripple's amplitude in the direction of the net torque."""
    if swing is None:
        return torque
    return torque + select(s.speed == 0.0, np.copysign(swing, torque - opposing), 0.0)


def _rigid(structure: Structure) -> Callable[..., Any]:
    """Return the motion of motor and user as one inertia, with kinematic backlash.

        ω⁺ from the friction law; θ' = θ + ω⁺ Δt, θ⁺ = min(max(θ', θ_low - b), θ_high + b)
        ω⁺ = 0 where θ⁺ ≠ θ';  θ_u⁺ = follow(θ_u, θ⁺, b)

    The end stops limit the user's side. A shaft at a stop has the speed 0 while the torque acts outwards.
    """
    speed_of, bristle_torque = friction.friction(structure), friction.bristles(structure)

    def rigid(s: Any, p: Any, step: Any, torque: Any, external: Any, swing: Any) -> Any:
        made = _torque_at_breakaway(s, torque, external, swing)
        free, bristles = speed_of(
            p, s.speed, bristle_torque(s), made, external, p.viscous, p.static, p.coulomb, p.step_per_inertia
        )
        reached = s.angle + free * step
        held = clip(reached, p.low_stop - p.half_gap, p.high_stop + p.half_gap)
        return select(held == reached, free, 0.0), held, follow(s.output, held, p.half_gap), bristles

    return rigid


def _compliant(structure: Structure) -> Callable[..., Any]:
    """Return the motion of motor and user as two inertias with separate friction, coupled by the shaft.

    Semi-implicit Euler: the speeds follow from the shaft's torque at the start of the step, the angles from
    the new speeds. There is no numerical damping; the natural frequency ω is too high by (ω Δt)²/24,
    relative. Friction that depends on the transmitted torque, on the direction or on the square of the speed,
    and the bristles, act on the motor's side.
    """
    speed_of, bristle_torque = friction.friction(structure), friction.bristles(structure)
    user_friction = structure._replace(
        load_dependent=False, directional=False, quadratic=False, presliding=False
    )
    user_speed_of = friction.friction(user_friction)

    def compliant(s: Any, p: Any, step: Any, torque: Any, external: Any, swing: Any) -> Any:
        passed = shaft_torque(s.angle - s.output, s.speed - s.user_speed, p.half_gap, p.stiffness, p.damping)
        speed, bristles = speed_of(
            p,
            s.speed,
            bristle_torque(s),
            _torque_at_breakaway(s, torque, passed, swing),
            passed,
            p.viscous - p.user_viscous,
            p.static - p.user_static,
            p.coulomb - p.user_coulomb,
            p.motor_step_per_inertia,
        )
        free, _ = user_speed_of(
            p,
            s.user_speed,
            (),
            passed,
            external,
            p.user_viscous,
            p.user_static,
            p.user_coulomb,
            p.user_step_per_inertia,
        )
        reached = s.output + free * step
        held = clip(reached, p.low_stop, p.high_stop)
        return speed, s.angle + speed * step, held, (select(held == reached, free, 0.0), *bristles)

    return compliant
