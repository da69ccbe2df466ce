"""The version of what computed a result."""

from importlib.metadata import version

VERSION = version("emaphm")
