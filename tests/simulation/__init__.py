"""Tests of how an actuator moves: each against something that does not share its code."""
