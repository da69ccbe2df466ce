"""Calibration by measured motion: choice of the loop, fit by inverse dynamics, and result."""
