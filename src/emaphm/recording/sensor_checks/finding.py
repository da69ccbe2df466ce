"""Result of a sensor check."""

from dataclasses import dataclass, field

import numpy as np

from emaphm.recording.sensor_checks.resolution import Mask


@dataclass(frozen=True, eq=False)
class SensorFinding:
    """A sensor fault that was detected from the sensor's own signal, without a model.

    Attributes
    ----------
    channel
        The column, or several columns joined by " and ".
    kind
        "frozen", "held", "clipped", "scale", "reversed" or "swapped".
    size, unit
        Size of the fault: number of held rows, time frozen, level of clipping, relative error of a scale.
    rows
        Whether each row of the channel is affected, (samples,); empty if all rows are.
    sentence
        Sentence on the fault, with sensor, size and place.
    """

    channel: str
    kind: str
    size: float
    unit: str
    sentence: str
    rows: Mask = field(default_factory=lambda: np.zeros(0, bool))
