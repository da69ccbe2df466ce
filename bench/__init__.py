"""Measurements of speed (pytest-benchmark)."""
