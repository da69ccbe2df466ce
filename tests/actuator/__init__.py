"""Tests of `emaphm.actuator`: parameters, faults, commands, channels, laws and sensors."""
