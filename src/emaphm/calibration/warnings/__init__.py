"""Warnings of a calibration: motion in one direction only, a wrong sign or unit, a missing law."""
