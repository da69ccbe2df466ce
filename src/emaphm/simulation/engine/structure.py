"""What a kernel is compiled for: the kind of drive, and the optional laws that the actuator has."""

from typing import NamedTuple


class Ripple(NamedTuple):
    """A harmonic of the torque: `order` per turn of the motor, or of the screw where `screw`."""

    order: int
    screw: bool = False


class Structure(NamedTuple):
    """Kind of drive and optional laws; a law that is False takes no time in a kernel.

    `commutation` is one that is not by the rotor's true angle; `load_variation` is how many coefficients a
    load has that varies over the run, `load_steps` how many times one steps.
    """

    drive: str = "hysteresis"
    position_pid: bool = False
    stribeck: bool = False
    load_dependent: bool = False
    directional: bool = False
    quadratic: bool = False
    transition: bool = False
    presliding: bool = False
    compliance: bool = False
    gravity: bool = False
    source: bool = False
    current_lag: bool = False
    voltage_drop: bool = False
    saturation: bool = False
    emf_shape: bool = False
    commutation: bool = False
    ripples: tuple[Ripple, ...] = ()
    load_variation: int = 0
    load_steps: int = 0

    @property
    def smooth_friction(self) -> bool:
        """Whether friction has more to it than a static and a dynamic level."""
        return any(
            (
                self.stribeck,
                self.load_dependent,
                self.directional,
                self.quadratic,
                self.transition,
                self.presliding,
            )
        )
