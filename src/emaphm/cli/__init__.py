"""Command line: parsing of arguments, calls of the library, and printing of results."""

try:
    from emaphm.cli.entry import main
except KeyboardInterrupt:  # later interruptions are handled by `main`
    raise SystemExit(130) from None

__all__ = ["main"]
