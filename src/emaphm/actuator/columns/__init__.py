"""Expressions and units of the columns of a file, as written in a description."""
