"""Faults of sensors that a recording shows before anything is identified."""

from emaphm.recording.sensor_checks.check import CheckedRecording, check_sensors
from emaphm.recording.sensor_checks.finding import SensorFinding

__all__ = ["CheckedRecording", "SensorFinding", "check_sensors"]
