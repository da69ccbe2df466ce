"""Result of a sensor check."""

from dataclasses import dataclass


@dataclass(frozen=True)
class SensorFinding:
    """A sensor fault that was detected from the sensor's own signal, without a model.

    Attributes
    ----------
    channel
        The column, or several columns joined by " and ".
    kind
        "frozen", "held", "clipped", "scale", "reversed", "swapped" or "noise".
    size, unit
        Size of the fault: number of held rows, time frozen, level of clipping, relative error of a scale,
        rms of the noise.
    sentence
        Sentence on the fault, with sensor, size and place.
    """

    channel: str
    kind: str
    size: float
    unit: str
    sentence: str
