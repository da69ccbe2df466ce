"""Prognosis: requirements, degradation, remaining useful life and its metrics."""
