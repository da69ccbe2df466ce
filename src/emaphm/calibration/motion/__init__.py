"""Calibration by measured motion: when it is used, the fit by inverse dynamics, and its result."""
