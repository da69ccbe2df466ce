"""Spoilt recordings of a known actuator: whether the diagnosis notices, corrects, or is confidently wrong."""
