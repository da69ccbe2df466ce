"""Verbs for units and fleets: history, requirements, remaining useful life, and monitoring in service."""
