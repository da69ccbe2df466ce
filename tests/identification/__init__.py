"""Tests of the identification room."""
