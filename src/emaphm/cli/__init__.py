"""The command line: it parses, calls the library, and prints."""

from emaphm.cli.main import app, main

__all__ = ["app", "main"]
