"""Code of the package on which a diagnosis depends; stored results keep its fingerprint (`execution`)."""

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
"""Sub-packages and files whose code determines the result of a diagnosis."""

NOT_DECIDING = ("actuator/toml", "diagnosis/text.py")
"""Parts of these sub-packages that only read descriptions or format text."""
