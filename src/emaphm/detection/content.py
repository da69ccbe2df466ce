"""What a detector has learned: the manoeuvres of healthy cycles, and seeded faults."""

from dataclasses import dataclass, field

from emaphm.actuator import Actuator
from emaphm.detection.manoeuvre import HealthyManoeuvre
from emaphm.detection.seeded import Seeded
from emaphm.detection.settings import DETECTOR, DetectorSettings


@dataclass(frozen=True, eq=False)
class DetectorContent:
    """What a file of `emaphm detect learn` holds.

    Attributes
    ----------
    channels
        What it looks at.
    manoeuvres
        Those that it has healthy cycles of.
    actuator
        Whose model explains what it can of a recording before; None where channels are taken as measured.
    seeded
        Deviations of recordings with known faults.
    """

    channels: tuple[str, ...]
    manoeuvres: tuple[HealthyManoeuvre, ...]
    actuator: Actuator | None = None
    seeded: tuple[Seeded, ...] = ()
    settings: DetectorSettings = field(default=DETECTOR)
