"""Tests of the server, and the commands that measure it."""
