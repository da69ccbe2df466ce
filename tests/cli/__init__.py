"""Tests of the command line, as somebody meets it who has never seen it."""
