"""Estimates by the reference model itself, where the corrected averaged model does not suffice."""
