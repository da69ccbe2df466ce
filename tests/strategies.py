"""Hypothesis strategies, and an actuator with all laws, for several folders of tests."""

from functools import reduce

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from emaphm.actuator import Actuator, Faults
from emaphm.actuator.laws import LAWS
from emaphm.estimation.space.nuisances import NAMES as NUISANCES

UNIT = st.floats(0.0, 1.0)
POSITIVE = st.floats(1e-9, 1e9)
NOT_NEGATIVE = st.just(0.0) | POSITIVE
SIGNED = NOT_NEGATIVE | POSITIVE.map(lambda value: -value)

EVERYTHING = reduce(
    lambda actuator, law: law.added_to(actuator),
    (law for name, law in LAWS.items() if name != "transition"),  # this law and presliding exclude each other
    Actuator.thesis(),
)
"""The thesis's actuator with all optional laws that can be combined."""


def fault_vectors() -> st.SearchStrategy[NDArray[np.float64]]:
    """Fault vectors k, shape (8,), anywhere in the unit cube."""
    return st.lists(UNIT, min_size=8, max_size=8).map(np.array)


def faults() -> st.SearchStrategy[Faults]:
    """Faults anywhere in the unit cube."""
    return fault_vectors().map(Faults.from_vector)


@st.composite
def actuators(draw: st.DrawFn) -> Actuator:
    """Draw valid actuators, rotary and linear, with and without each optional part."""
    static = draw(NOT_NEGATIVE), draw(NOT_NEGATIVE)
    share = draw(st.just(0.0) | st.floats(1e-3, 1.0))
    mechanics = {
        "inertia_motor": draw(POSITIVE),
        "inertia_user": draw(NOT_NEGATIVE),
        "viscous_motor": draw(NOT_NEGATIVE),
        "viscous_user": draw(NOT_NEGATIVE),
        "static_friction_motor": static[0],
        "static_friction_user": static[1],
        "dynamic_friction_motor": share * static[0],
        "dynamic_friction_user": share * static[1],
        "backlash": draw(NOT_NEGATIVE),
        "offset": draw(SIGNED),
        "hinge": draw(SIGNED),
        "gear_ratio": draw(POSITIVE),
        "end_stops": draw(st.none() | st.tuples(POSITIVE.map(lambda stop: -stop), POSITIVE)),
    }
    controller = {
        "position_gain": draw(POSITIVE),
        "speed_gain": draw(POSITIVE),
        "integral_gain": draw(NOT_NEGATIVE),
        "derivative_gain": draw(NOT_NEGATIVE),
        "speed_lag": draw(NOT_NEGATIVE),
        "speed_limit": draw(st.none() | POSITIVE),
        "current_limit": draw(POSITIVE),
        "torque_constant": draw(POSITIVE),
    }
    electrical = {
        "supply": draw(POSITIVE),
        "resistance": draw(POSITIVE),
        "inductance": draw(POSITIVE),
        "pole_pairs": draw(st.integers(1, 50)),
        "hysteresis": draw(POSITIVE),
        "temperature": draw(POSITIVE),
    }
    fault_scales = {
        "friction": draw(POSITIVE),
        "backlash": draw(POSITIVE),
        "eccentricity": draw(st.floats(0.01, 0.99)),
        "gain": draw(st.floats(0.01, 0.99)),
    }
    estimated = draw(st.lists(st.sampled_from(NUISANCES), unique=True))
    priors = draw(st.dictionaries(st.sampled_from(NUISANCES), POSITIVE))
    return Actuator.from_dict(
        {
            "name": draw(st.text(min_size=1)),
            "coordinates": draw(st.sampled_from(["rotary", "linear", "screw"])),
            "controller": controller,
            "motor": {
                "torque_constant": draw(POSITIVE),
                "torque_limit": draw(st.none() | POSITIVE),
                "torque_lag": draw(NOT_NEGATIVE),
            },
            "mechanics": mechanics,
            "electrical": draw(st.none() | st.just(electrical)),
            "faults": fault_scales,
            "nuisances": {"estimated": estimated} | priors,
            "channels": {
                "sampling": draw(st.sampled_from(["mean", "instant"])),
                "command_rad": draw(st.text()),
            },
        }
    )
