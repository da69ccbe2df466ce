"""What a check of a sensor found."""

from dataclasses import dataclass, field

import numpy as np

from emaphm.recording.sensor_checks.resolution import Mask


@dataclass(frozen=True, eq=False)
class SensorFinding:
    """A fault of a sensor that its own signal shows, before any model is asked.

    Attributes
    ----------
    channel
        The column, or columns, " and " between them.
    kind
        "frozen", "held", "clipped", "scale", "reversed" or "swapped".
    size, unit
        How much of it: rows held, seconds frozen, the level clipped at, the relative error of a scale.
    rows
        Whether each row of the channel is spoilt, (samples,); empty where all of them are.
    sentence
        What was found, with sensor, size and place.
    """

    channel: str
    kind: str
    size: float
    unit: str
    sentence: str
    rows: Mask = field(default_factory=lambda: np.zeros(0, bool))
