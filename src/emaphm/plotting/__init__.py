"""Figures of results; each is drawn by the result it belongs to, on demand."""
