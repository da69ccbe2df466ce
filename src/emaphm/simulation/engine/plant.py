"""The actuators of a batch: their physical quantities side by side, faults applied."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from emaphm.actuator import Actuator
from emaphm.actuator.faults import NAMES, SHORTEST_WINDING
from emaphm.actuator.lumped_parameters import check_totals, static_follows
from emaphm.arrays import Array
from emaphm.errors import FaultError, MethodError

NO_LIMIT = 1e30
"""Value of an absent limit; the kernels are compiled to assume that nothing is infinite."""

NEVER_ZERO = (
    "inertia",
    "position_gain",
    "speed_gain",
    "torque_constant",
    "resistance",
    "inductance",
    "supply",
)

SIGNED = ("offset", "hinge")


@dataclass(frozen=True)
class Plant:
    """Quantities of `n` actuators, each of shape (n,), SI units; turns and z have a row a phase or axis.

    Friction, backlash and position gain have their faults applied; the windings are described by the
    healthy line-to-line values and `turns` (3, n), the fraction of healthy turns in each phase;
    `z` (2, n) is Z (cos phi, sin phi).
    """

    inertia: Array
    viscous: Array
    coulomb: Array
    static: Array
    offset: Array
    hinge: Array
    backlash: Array
    gear_ratio: Array
    low_stop: Array
    high_stop: Array
    position_gain: Array
    speed_gain: Array
    integral_gain: Array
    derivative_gain: Array
    speed_limit: Array
    current_limit: Array
    drive_constant: Array
    speed_lag: Array
    torque_constant: Array
    torque_limit: Array
    torque_lag: Array
    supply: Array
    resistance: Array
    inductance: Array
    hysteresis: Array
    pole_pairs: Array
    turns: Array
    z: Array

    @staticmethod
    def of(actuator: Actuator, faults: ArrayLike, totals: Mapping[str, ArrayLike] | None = None) -> "Plant":
        """Return the plants of `actuator` under `faults`.

        Parameters
        ----------
        faults
            Normalised fault vectors, shape (n, 8).
        totals
            Parameters to set instead of the actuator's, by their names in `TOTALS`;
            each of shape (n,) or a scalar. Friction faults multiply them.

        Raises
        ------
        FaultError
            `faults` has another shape or a value outside [0, 1].
        MethodError
            A total is unknown, impossible or not one value an actuator, or needs the electrical
            description that the actuator lacks.
        """
        k = np.atleast_2d(np.asarray(faults, float))
        if k.ndim != 2 or k.shape[1] != len(NAMES):
            raise FaultError(f"fault vectors have shape (n, {len(NAMES)}), got {np.shape(faults)}")
        outside = np.argwhere(~((k >= 0) & (k <= 1)))
        if outside.size:
            row, column = outside[0]
            raise FaultError(
                f"fault {NAMES[column]}={k[row, column]:g} of vector {row} lies outside [0, 1]; "
                "give a value from 0 to 1"
            )
        return _with_faults(_with_totals(_healthy(actuator, len(k)), actuator, totals or {}), actuator, k)

    @property
    def has_windings(self) -> bool:
        """Whether the windings are described; without them the current loop is ideal."""
        return bool(self.hysteresis[0] > 0)

    @property
    def count(self) -> int:
        """The number of actuators, n."""
        return int(self.inertia.size)


def _healthy(actuator: Actuator, n: int) -> Plant:
    m, c, motor, e = actuator.mechanics, actuator.controller, actuator.motor, actuator.electrical
    low, high = m.end_stops or (-NO_LIMIT, NO_LIMIT)
    scalars = {
        "inertia": m.inertia,
        "viscous": m.viscous,
        "coulomb": m.dynamic_friction,
        "static": m.static_friction,
        "offset": m.offset,
        "hinge": m.hinge,
        "backlash": m.backlash,
        "gear_ratio": m.gear_ratio,
        "low_stop": low / m.gear_ratio,
        "high_stop": high / m.gear_ratio,
        "position_gain": c.position_gain,
        "speed_gain": c.speed_gain,
        "integral_gain": c.integral_gain,
        "derivative_gain": c.derivative_gain,
        "speed_limit": c.speed_limit or NO_LIMIT,
        "current_limit": c.current_limit,
        "drive_constant": c.torque_constant,
        "speed_lag": c.speed_lag,
        "torque_constant": motor.torque_constant,
        "torque_limit": motor.torque_limit or NO_LIMIT,
        "torque_lag": motor.torque_lag,
        # An ideal current loop is one whose supply can force any current within a step.
        "supply": e.supply if e else 1e12,
        "resistance": e.resistance if e else 1.0,
        "inductance": e.inductance if e else 1e-12,
        "hysteresis": e.hysteresis if e else 0.0,
        "pole_pairs": e.pole_pairs if e else 1,
    }
    columns = np.repeat(np.array(list(scalars.values()), float)[:, np.newaxis], n, axis=1)
    return Plant(**dict(zip(scalars, columns, strict=True)), turns=np.ones((3, n)), z=np.zeros((2, n)))


def _with_totals(plant: Plant, actuator: Actuator, totals: Mapping[str, ArrayLike]) -> Plant:
    check_totals(actuator, totals)
    set_to = {}
    for name, values in static_follows(actuator, totals).items():
        column = np.asarray(values, float)
        if column.shape not in {(), (plant.count,)}:
            raise MethodError(
                f"parameter '{name}' has shape {column.shape}; give one value, or {plant.count}"
            )
        if not np.all(np.isfinite(column)) or (np.any(column < 0) and name not in SIGNED):
            raise MethodError(f"parameter '{name}' must be finite and not negative; correct its value")
        if name in NEVER_ZERO and np.any(column == 0):
            raise MethodError(f"parameter '{name}' must be greater than 0; correct its value")
        set_to[name] = np.broadcast_to(column, (plant.count,))
    changed = replace(plant, **set_to)
    # Friction larger than what it has to balance would push a standing shaft.
    return replace(changed, static=np.maximum(changed.static, changed.coulomb))


def _with_faults(plant: Plant, actuator: Actuator, k: Array) -> Plant:
    scales = actuator.faults
    friction = 1 + scales.friction * k[:, 0]
    phase = (2 * k[:, 6] - 1) * np.pi
    return replace(
        plant,
        coulomb=plant.coulomb * friction,
        static=plant.static * friction,
        backlash=plant.backlash * (1 + scales.backlash * k[:, 1]),
        turns=np.maximum(1 - k[:, 2:5].T, SHORTEST_WINDING),
        z=scales.eccentricity * k[:, 5] * np.stack([np.cos(phase), np.sin(phase)]),
        position_gain=plant.position_gain * (1 + scales.gain * (2 * k[:, 7] - 1)),
    )
