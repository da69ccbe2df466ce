"""Measurements of speed (pytest-benchmark) and of accuracy."""
