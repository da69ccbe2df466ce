"""The classes of spoilt recordings: the change, and the sets of channels to which it is applied."""

from dataclasses import dataclass

from emaphm.actuator import Actuator
from emaphm.recording.schema import PHASES
from emaphm.study.spoilt import changes
from emaphm.study.spoilt.changes import Change, WrongActuator
from emaphm.study.spoilt.source import CHIRP, SpoiltChirp

TOTAL = ("current", "voltage", "motion")
"""Sets of channels with the equivalent current."""

ALL = (*TOTAL, "phases")
WITH_VOLTAGE = ("voltage", "motion")
MOTION = ("motion",)
PHASE = ("phases",)

LENGTHS = ("command_rad", "position_rad")

DEGREES = 57.29577951308232
RPM = 9.549296585513721
"""One radian in degrees, one radian per second in revolutions per minute."""


def as_described(actuator: Actuator) -> Actuator:
    """Return the true description."""
    return actuator


@dataclass(frozen=True)
class SpoiltClass:
    """A class of spoilt recordings: `group` is its kind, `sets` are the sets of channels that it changes.

    `described` returns the description for the diagnosis from the true description. `control` marks
    recordings that are not spoilt: they must be explained, with correct verdicts.
    """

    name: str
    group: str
    sets: tuple[str, ...]
    change: Change = changes.unchanged
    described: WrongActuator = as_described
    manoeuvre: SpoiltChirp = CHIRP
    control: bool = False


def _controls() -> list[SpoiltClass]:
    return [SpoiltClass("as recorded", "control", ALL, control=True)]


def _rates_and_times() -> list[SpoiltClass]:
    slow = SpoiltClass("100 Hz for 5 s", "rate", TOTAL, manoeuvre=SpoiltChirp(5.0, 100.0))
    shifts = [
        SpoiltClass(f"sensed channels {abs(n)} rows {way}", "delay", ALL, changes.late(n))
        for n, way in ((1, "late"), (-1, "early"), (5, "late"), (-5, "early"))
    ]
    scaled = [
        SpoiltClass(f"time × {factor:g}", "time", sets, changes.linear("time_s", factor))
        for factor, sets in ((1.01, TOTAL), (1.1, TOTAL), (1e3, WITH_VOLTAGE))
    ]
    late_position = changes.late(20, ("position_rad",))
    return [slow, *shifts, *scaled, SpoiltClass("position 20 rows late", "delay", MOTION, late_position)]


def _voltage() -> list[SpoiltClass]:
    name = "voltage_V"
    return [
        SpoiltClass("voltage reversed", "voltage", WITH_VOLTAGE, changes.linear(name, -1.0)),
        SpoiltClass("voltage × 0.5", "voltage", WITH_VOLTAGE, changes.linear(name, 0.5)),
        SpoiltClass("voltage zero", "voltage", WITH_VOLTAGE, changes.constant(name, 0.0)),
        SpoiltClass("voltage constant", "voltage", WITH_VOLTAGE, changes.constant(name, 30.0)),
        SpoiltClass("voltage × 1000", "voltage", WITH_VOLTAGE, changes.linear(name, 1e3)),
        SpoiltClass("voltage frozen from half", "voltage", WITH_VOLTAGE, changes.frozen(name, 0.5)),
        SpoiltClass("voltage white noise of 50 V", "voltage", WITH_VOLTAGE, changes.white(name, 50.0)),
        SpoiltClass("voltage + 10 V", "voltage", WITH_VOLTAGE, changes.linear(name, 1.0, 10.0)),
        SpoiltClass("voltage and speed swapped", "voltage", MOTION, _swapped("voltage_V", "speed_rad_s")),
    ]


def _motion() -> list[SpoiltClass]:
    speed, position = "speed_rad_s", "position_rad"
    return [
        SpoiltClass("speed reversed", "speed", MOTION, changes.linear(speed, -1.0)),
        SpoiltClass("speed in rpm", "speed", MOTION, changes.linear(speed, RPM)),
        SpoiltClass("speed zero", "speed", MOTION, changes.constant(speed, 0.0)),
        SpoiltClass("speed × 1.2", "speed", MOTION, changes.linear(speed, 1.2)),
        SpoiltClass("speed's magnitude", "speed", MOTION, changes.rectified(speed)),
        SpoiltClass("speed dropped for a fifth", "speed", MOTION, changes.dropped(speed, 0.5, 0.7)),
        SpoiltClass("position reversed", "position", MOTION, changes.linear(position, -1.0)),
        SpoiltClass("position doubled", "position", MOTION, changes.linear(position, 2.0)),
        SpoiltClass("position constant", "position", MOTION, changes.constant(position)),
        SpoiltClass("position + 2 mrad", "position", MOTION, changes.linear(position, 1.0, 2e-3)),
        SpoiltClass("position drifts by 1 mrad", "position", MOTION, changes.drifting(position, 1e-3)),
        SpoiltClass("position held for 50 rows", "position", MOTION, changes.held(position, 50)),
        SpoiltClass(
            "command + 2 mrad", "command", ("current", "voltage"), changes.linear("command_rad", 1.0, 2e-3)
        ),
        SpoiltClass("command reversed", "command", WITH_VOLTAGE, changes.linear("command_rad", -1.0)),
        SpoiltClass("lengths in degrees", "unit", WITH_VOLTAGE, changes.scaled(LENGTHS, DEGREES)),
        SpoiltClass("lengths in milliradians", "unit", WITH_VOLTAGE, changes.scaled(LENGTHS, 1e3)),
    ]


def _current() -> list[SpoiltClass]:
    name, two = "current_A", ("current", "voltage")
    return [
        SpoiltClass("current white noise of 3 A", "current", TOTAL, changes.white(name, 3.0)),
        SpoiltClass("current + noise of 3 A", "current", two, changes.noisier(name, 3.0)),
        SpoiltClass("five spikes of 22 A", "current", TOTAL, changes.spikes(name, 22.0, 5)),
        SpoiltClass("current × 1.2", "current", TOTAL, changes.linear(name, 1.2)),
        SpoiltClass("current × 0.8", "current", two, changes.linear(name, 0.8)),
        SpoiltClass("current + 1 A", "current", two, changes.linear(name, 1.0, 1.0)),
        SpoiltClass("current reversed", "current", two, changes.linear(name, -1.0)),
        SpoiltClass("current's magnitude", "current", two, changes.rectified(name)),
        SpoiltClass("current clipped at 60 %", "current", two, changes.clipped(name, 0.6)),
        SpoiltClass("current frozen from half", "current", two, changes.frozen(name, 0.5)),
        SpoiltClass("current held for 10 rows", "current", two, changes.held(name, 10)),
        SpoiltClass("current dropped for a tenth", "current", two, changes.dropped(name, 0.6, 0.7)),
        SpoiltClass("current lags 2 ms", "current", two, changes.lagging(name, 2e-3)),
        SpoiltClass("current + hum of 1 A", "current", two, changes.hum(name, 1.0, 50.0)),
        SpoiltClass("current in mA", "unit", two, changes.linear(name, 1e3)),
        SpoiltClass("current in kA", "unit", MOTION, changes.linear(name, 1e-3)),
    ]


def _phases() -> list[SpoiltClass]:
    a, b, c = PHASES
    return [
        SpoiltClass("phase a × 1.2", "phases", PHASE, changes.linear(a, 1.2)),
        SpoiltClass("phase c × 0.9", "phases", PHASE, changes.linear(c, 0.9)),
        SpoiltClass("phases swapped", "phases", PHASE, _swapped(a, b)),
        SpoiltClass("phases rotated", "phases", PHASE, changes.exchanged(PHASES, (b, c, a))),
        SpoiltClass("phases negated", "phases", PHASE, changes.scaled(PHASES, -1.0)),
        SpoiltClass("phase b missing", "phases", PHASE, changes.constant(b, 0.0)),
        SpoiltClass("angle reversed", "phases", PHASE, changes.linear("angle_rad", -1.0)),
        SpoiltClass("angle + 0.1 rad", "phases", PHASE, changes.linear("angle_rad", 1.0, 0.1)),
    ]


def _known_values() -> list[SpoiltClass]:
    return [
        *(
            SpoiltClass(f"temperature {k:g} K", "known value", TOTAL, changes.added("temperature_K", k))
            for k in (200.0, 400.0)
        ),
        *(
            SpoiltClass(f"load {load:g} N·m", "known value", WITH_VOLTAGE, changes.added("load_Nm", load))
            for load in (0.3, -0.3)
        ),
    ]


def _descriptions() -> list[SpoiltClass]:
    wrong = changes.described_with
    return [
        SpoiltClass("resistance × 3", "description", TOTAL, described=wrong("electrical", resistance=3.0)),
        SpoiltClass("pole pairs × 2", "description", TOTAL, described=wrong("electrical", pole_pairs=2.0)),
        SpoiltClass("supply × 0.5", "description", TOTAL, described=wrong("electrical", supply=0.5)),
        SpoiltClass("gear ratio × 2", "description", TOTAL, described=wrong("mechanics", gear_ratio=2.0)),
        SpoiltClass(
            "rotor's zero + 0.4 rad", "description", TOTAL, described=changes.described_at(rotor_zero=0.4)
        ),
        SpoiltClass("speed gain × 1.5", "description", TOTAL, described=wrong("controller", speed_gain=1.5)),
        *_toleranced("torque constant × 1.3", 0.3, "motor", torque_constant=1.3),
        *_toleranced("torque constant × 1.1", 0.1, "motor", torque_constant=1.1),
        *_toleranced("resistance × 1.1", 0.1, "electrical", resistance=1.1),
        *_toleranced("speed gain × 1.1", 0.1, "controller", speed_gain=1.1),
    ]


def _toleranced(name: str, tolerance: float, section: str, **factors: float) -> list[SpoiltClass]:
    """Return a wrong parameter twice: taken as exact, and with its tolerance stated."""
    exact = changes.described_with(section, **factors)
    stated = changes.with_tolerances(exact, **dict.fromkeys(factors, tolerance))
    return [
        SpoiltClass(name, "description", TOTAL, described=exact),
        SpoiltClass(f"{name}, ± {100 * tolerance:.0f} % stated", "description", TOTAL, described=stated),
    ]


def _swapped(first: str, second: str) -> Change:
    return changes.exchanged((first, second), (second, first))


CLASSES: tuple[SpoiltClass, ...] = (
    *_controls(),
    *_rates_and_times(),
    *_voltage(),
    *_motion(),
    *_current(),
    *_phases(),
    *_known_values(),
    *_descriptions(),
)
"""All classes, in the order of the page."""
