"""The command line: it parses, calls the library, and prints."""

from emaphm.cli.entry import main

__all__ = ["main"]
