"""Tests of what an actuator is: parameters, faults, commands."""
