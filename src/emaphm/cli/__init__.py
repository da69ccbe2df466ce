"""The command line: it parses, calls the library, and prints."""

try:
    from emaphm.cli.entry import main
except KeyboardInterrupt:  # from now on `main` deals with it
    raise SystemExit(130) from None

__all__ = ["main"]
