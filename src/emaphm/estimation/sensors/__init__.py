"""Sensors between a model and its recording: described errors, unknown errors, exchanged channels."""
