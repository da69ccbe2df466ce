"""Rows as they come on a pipe: parsed, put in order, gathered to movements."""
