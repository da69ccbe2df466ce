"""Recordings watched as they arrive."""
