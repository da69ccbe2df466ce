"""Content of a detector: the learned manoeuvres of healthy cycles, and seeded faults."""

from dataclasses import dataclass, field

from emaphm.actuator import Actuator
from emaphm.detection.manoeuvre import HealthyManoeuvre
from emaphm.detection.seeded import Seeded
from emaphm.detection.settings import DETECTOR, DetectorSettings


@dataclass(frozen=True, eq=False)
class DetectorContent:
    """The content of a file that `emaphm detect learn` writes.

    Attributes
    ----------
    channels
        The channels that it evaluates.
    manoeuvres
        The manoeuvres for which it has healthy cycles.
    actuator
        The description whose model's output is subtracted first; None if channels are evaluated as measured.
    seeded
        Mean deviations of recordings with known faults.
    """

    channels: tuple[str, ...]
    manoeuvres: tuple[HealthyManoeuvre, ...]
    actuator: Actuator | None = None
    seeded: tuple[Seeded, ...] = ()
    settings: DetectorSettings = field(default=DETECTOR)
