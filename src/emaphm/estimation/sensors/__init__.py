"""Sensors between a model and its recording: as described, their unknown errors, channels exchanged."""
