"""First description of an actuator: a built-in description, changed by the answers to a few questions."""

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
"""Kinds of machine: the built-in actuator that is the start of the description, and its explanation."""

QUESTIONS = (
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
"""Section and field of the values that a data sheet states, so that no calibration has to estimate them."""

TOLERANCED = {
    "torque_constant": "motor",
    "resistance": "electrical",
    "inductance": "electrical",
    "inertia": "mechanics",
}
"""Parameters whose data-sheet values are valid for a type and not for a single unit, with their sections."""

NONE = "none"
"""Answer that leaves a value out of the description."""

USUAL_TOLERANCE = 0.1
"""Typical tolerance of torque constant and resistance on the data sheets of servo motors, relative."""

HEADING = """\
First description of '{name}', from the built-in '{machine}' ({meaning}).
Values that you did not give are those of the built-in actuator; friction, inertia, backlash and the
controller's gains will differ on your machine. Correct the values for which you have data, then estimate
the others with `emaphm calibrate` from recordings of the healthy unit."""

ENDING = """\
Optional sections of a description. To use a line, remove its leading '# '.

[channels]                       # names, units and signs of your logger's columns
sampling = "instant"             # rows are instants; "mean": means over the interval
command_rad = "setpoint"
position_rad = { column = "encoder", unit = "deg" }
current_A = { column = "motor_current", scale = -1.0 }

[sensors.current_A]              # errors of a sensor that is not used by the drive
resolution = 0.01

[tolerances]                     # relative deviation of a unit from these values: 0.1 is ± 10 %
torque_constant = 0.1
inertia = 0.1

[nuisances]                      # standard deviations of unknowns that are no faults
load = 0.1
temperature = 20.0

[[requirements]]                 # the remaining useful life ends when a requirement fails
component = "backlash"
at_most = 0.6
"""


def machine_named(name: str) -> str:
    """Return the key in `MACHINES` of a machine's `name`, its own name or that of its built-in actuator.

    Raises
    ------
    ActuatorError
        No such machine; the message names the nearest.
    """
    names = {preset: machine for machine, (preset, _) in MACHINES.items()} | {name: name for name in MACHINES}
    if name not in names:
        known = ", ".join(MACHINES)
        suggestion = "" if closest(name, names) is None else nearest(name, names)
        raise ActuatorError(f"unknown machine '{name}'{suggestion}; give one of {known}")
    return names[name]


def template(machine: str) -> Actuator:
    """Return the description from which that of a `machine`, one of `MACHINES`, starts."""
    described = Actuator.load(MACHINES[machine][0])
    # By default, the drive assumes the torque constant of the motor.
    controller = described.controller.model_copy(update={"torque_constant": None})
    return described.model_copy(update={"name": machine, "controller": controller})


def interview(
    actuator: Actuator, ask: Callable[[str, str], str], refuse: Callable[[str], None]
) -> tuple[Actuator, int]:
    """Return `actuator` with the answers to a few questions, and the number of answers.

    Parameters
    ----------
    actuator
        Provides the values of questions without an answer.
    ask
        Takes a question and the present value, as text; returns the answer: empty to keep the value, "none"
        to leave out an optional value.
    refuse
        Takes the reason why an answer is not accepted; the question is then repeated.
    """
    actuator, given = _with_answer(actuator, ("name",), "name or type number", ask, refuse)
    for section, field in QUESTIONS:
        described = getattr(actuator, section)
        if described is not None:
            question = _question(type(described), field, actuator.coordinates)
            actuator, answered = _with_answer(actuator, (section, field), question, ask, refuse)
            given += answered
    actuator, answered = _with_tolerances(actuator, ask, refuse)
    return actuator, given + answered


def _with_tolerances(
    actuator: Actuator, ask: Callable[[str, str], str], refuse: Callable[[str], None]
) -> tuple[Actuator, int]:
    """Return `actuator` with one tolerance of all `TOLERANCED` parameters, and the number of answers."""
    names = [name for name, section in TOLERANCED.items() if getattr(actuator, section) is not None]
    question = f"tolerance of {', '.join(names)}, relative; 0 if the values were measured on this unit"
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


def _with_answer(
    actuator: Actuator,
    place: tuple[str, ...],
    question: str,
    ask: Callable[[str, str], str],
    refuse: Callable[[str], None],
) -> tuple[Actuator, int]:
    """Return `actuator` with the answer to a question on the field at `place`, and the number of answers."""
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
    """Return the number in `answer`, or a list of numbers separated by commas; other text is unchanged."""
    try:
        return json.loads(f"[{answer}]" if "," in answer else answer)
    except ValueError:
        return answer


def _question(section: type[BaseModel], field: str, coordinates: str) -> str:
    described = section.model_fields[field]
    extra = described.json_schema_extra
    unit = unit_for(str(extra["unit"]), coordinates) if isinstance(extra, dict) else ""
    types = (described.annotation, *get_args(described.annotation))
    # The part after a semicolon concerns leaving the value out of the file; here, no answer keeps the value.
    meaning = str(described.description).partition(";")[0]
    or_none = f", or {NONE}" if type(None) in types else ""
    return f"{meaning} [{'whole number' if int in types else unit}]{or_none}"
