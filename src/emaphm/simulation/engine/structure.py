"""Structure of an actuator: its kind of drive and its optional laws, for which a kernel is compiled."""

from typing import NamedTuple


class Ripple(NamedTuple):
    """Harmonic of the torque ripple: `order` per turn of the motor, or of the screw if `screw` is true."""

    order: int
    screw: bool = False


class Structure(NamedTuple):
    """Kind of drive and optional laws; a law that is False takes no time in a kernel.

    `commutation` is commutation with errors of the rotor's angle; `load_variation` is the number of
    coefficients of a load that varies over the run, `load_steps` the number of load steps.
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
        """Whether friction has an optional law in addition to its static and dynamic levels."""
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
