"""Which code of the package decides a diagnosis: what keeps results takes its fingerprint (`execution`)."""

DECIDING = (
    "actuator",
    "simulation",
    "recording",
    "optimizers",
    "estimation",
    "diagnosis",
    "arrays.py",
    "quantiles.py",
    "random_streams.py",
)
"""The rooms and files whose code decides what a recording is found to show."""

NOT_DECIDING = ("actuator/toml", "diagnosis/text.py")
"""Parts of these rooms that only read descriptions or lay out text."""
