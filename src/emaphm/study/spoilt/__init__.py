"""Spoilt recordings of a known actuator: whether a diagnosis notices, corrects, or errs undetected."""
