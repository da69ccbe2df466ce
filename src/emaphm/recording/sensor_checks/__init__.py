"""Detection of sensor faults in a recording without a model."""

from emaphm.recording.sensor_checks.check import CheckedRecording, check_sensors
from emaphm.recording.sensor_checks.finding import SensorFinding

__all__ = ["CheckedRecording", "SensorFinding", "check_sensors"]
