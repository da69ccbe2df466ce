"""A first description of somebody's actuator: a built-in one, changed by few answers."""

import json
from collections.abc import Callable
from typing import Any, get_args

from pydantic import BaseModel

from emaphm.actuator.actuator import Actuator
from emaphm.actuator.quantity import unit_for
from emaphm.errors import ActuatorError, closest, nearest

MACHINES: dict[str, tuple[str, str]] = {
    "bldc": ("thesis", "three-phase brushless motor, trapezoidal back-EMF, hysteresis current control"),
    "six-step": (
        "six-step",
        "three-phase brushless motor, trapezoidal back-EMF, PI current control with pulse-width modulation",
    ),
    "pmsm": ("pmsm", "three-phase permanent-magnet synchronous motor, field-oriented control"),
    "dc": ("dc", "DC motor behind an ideal current loop"),
}
"""Kinds of machine: the built-in actuator that each starts from, and what it is."""

ASKED = (
    ("electrical", "supply"),
    ("electrical", "resistance"),
    ("electrical", "inductance"),
    ("electrical", "pole_pairs"),
    ("motor", "torque_constant"),
    ("controller", "current_limit"),
    ("mechanics", "inertia_motor"),
    ("mechanics", "gear_ratio"),
    ("mechanics", "end_stops"),
)
"""What a data sheet says and no calibration should have to find, section and field."""

TOLERANCED = {
    "torque_constant": "motor",
    "resistance": "electrical",
    "inductance": "electrical",
    "inertia": "mechanics",
}
"""Parameters whose values on a data sheet are those of a type, not of the unit, and their sections."""

NONE = "none"
"""Answer where there is no such thing."""

USUAL_TOLERANCE = 0.1
"""Usual on the data sheets of servo motors, for torque constant and resistance."""

HEADING = """\
First description of '{name}', from the built-in '{machine}' ({meaning}).
Values that you did not give are those of that built-in actuator: friction, inertia, backlash and the
controller's gains are surely others on your machine. Correct what you have data for, then let
`emaphm calibrate` find the rest from recordings of the healthy unit."""

ENDING = """\
What else a description may hold. Take the leading '# ' out where it applies.

[channels]                       # the names that your logger gives, its units and signs
sampling = "instant"             # rows are instants; "mean": means over the interval
command_rad = "setpoint"
position_rad = { column = "encoder", unit = "deg" }
current_A = { column = "motor_current", scale = -1.0 }

[sensors.current_A]              # errors of a sensor that the drive does not see
resolution = 0.01

[tolerances]                     # how far a value may be off from unit to unit: 0.1 is ± 10 %
torque_constant = 0.1
inertia = 0.1

[nuisances]                      # how large an unknown that is no fault may be, one standard deviation
load = 0.1
temperature = 20.0

[[requirements]]                 # what the actuator must do: its remaining useful life ends where one fails
component = "backlash"
at_most = 0.6
"""


def machine_named(name: str) -> str:
    """Return which of `MACHINES` has a `name`: its own, or that of the built-in actuator.

    Raises
    ------
    ActuatorError
        No such machine; the message names the nearest.
    """
    names = {preset: machine for machine, (preset, _) in MACHINES.items()} | {one: one for one in MACHINES}
    if name not in names:
        known = ", ".join(MACHINES)
        meant = "" if closest(name, names) is None else nearest(name, names)
        raise ActuatorError(f"unknown machine '{name}'{meant}; give one of {known}")
    return names[name]


def template(machine: str) -> Actuator:
    """Return what a description of a `machine`, one of `MACHINES`, starts from."""
    described = Actuator.load(MACHINES[machine][0])
    # The drive assumes what the motor has, until somebody says otherwise.
    controller = described.controller.model_copy(update={"torque_constant": None})
    return described.model_copy(update={"name": machine, "controller": controller})


def interview(
    actuator: Actuator, ask: Callable[[str, str], str], refuse: Callable[[str], None]
) -> tuple[Actuator, int]:
    """Return `actuator` with the answers to few questions, and how many answers were given.

    Parameters
    ----------
    actuator
        Gives the values of what is not answered.
    ask
        Takes a question and the present value, as text; returns the answer, empty to keep the value, "none"
        to leave out one that need not be.
    refuse
        Takes the reason why an answer is not accepted; the question is asked again.
    """
    actuator, given = _answered(actuator, ("name",), "name or type number", ask, refuse)
    for section, field in ASKED:
        described = getattr(actuator, section)
        if described is not None:
            question = _question(type(described), field, actuator.coordinates)
            actuator, answered = _answered(actuator, (section, field), question, ask, refuse)
            given += answered
    actuator, answered = _toleranced(actuator, ask, refuse)
    return actuator, given + answered


def _toleranced(
    actuator: Actuator, ask: Callable[[str, str], str], refuse: Callable[[str], None]
) -> tuple[Actuator, int]:
    names = [name for name, section in TOLERANCED.items() if getattr(actuator, section) is not None]
    question = f"tolerance of {', '.join(names)}, relative; 0 if they are this unit's own, measured"
    values: Any = actuator.model_dump(mode="json", exclude_none=True)
    while True:
        answer = ask(question, _text(USUAL_TOLERANCE)).strip()
        tolerance = _value(answer) if answer else USUAL_TOLERANCE
        if tolerance == 0:
            return actuator, 1
        try:
            values["tolerances"] = dict.fromkeys(names, tolerance)
            return Actuator.from_dict(values, where=f"'{answer}'"), int(bool(answer))
        except ActuatorError as error:
            refuse(str(error))


def _answered(
    actuator: Actuator,
    place: tuple[str, ...],
    question: str,
    ask: Callable[[str, str], str],
    refuse: Callable[[str], None],
) -> tuple[Actuator, int]:
    values: Any = actuator.model_dump(mode="json", exclude_none=True)
    *sections, field = place
    section = values[sections[0]] if sections else values
    present = section.get(field)
    while True:
        answer = ask(question, _text(present)).strip()
        if not answer:
            return actuator, 0
        try:
            section[field] = answer if field == "name" else None if answer == NONE else _value(answer)
            return Actuator.from_dict(values, where=f"'{answer}'"), 1
        except ActuatorError as error:
            refuse(str(error))


def _text(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return ", ".join(f"{item:g}" for item in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _value(answer: str) -> Any:
    """Return a number, or several of them with commas between; what is neither stays text, to be refused."""
    try:
        return json.loads(f"[{answer}]" if "," in answer else answer)
    except ValueError:
        return answer


def _question(section: type[BaseModel], field: str, coordinates: str) -> str:
    described = section.model_fields[field]
    extra = described.json_schema_extra
    unit = unit_for(str(extra["unit"]), coordinates) if isinstance(extra, dict) else ""
    types = (described.annotation, *get_args(described.annotation))
    # What follows a semicolon is about the file, where a value may be left out; here that keeps the value.
    meaning = str(described.description).partition(";")[0]
    or_none = f", or {NONE}" if type(None) in types else ""
    return f"{meaning} [{'whole number' if int in types else unit}]{or_none}"
