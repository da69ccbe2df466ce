"""Notes on values of the future stress that are not used, or are clipped."""

from emaphm.prognosis.stress import STRESSES, Stress, StressReference


def stress_notes(ahead: Stress | None, reference: StressReference | None) -> list[str]:
    """Return notes on values of the stress `ahead` that are not used, or clipped, for lack of records."""
    if ahead is None:
        return []
    reference = reference or StressReference()
    values = reference.values
    names = [
        name
        for name, value, reference_value in zip(STRESSES, ahead.values, values, strict=True)
        if value is not None and reference_value is None
    ]
    missing = f"not recorded in the history, and therefore not used in the future stress: {', '.join(names)}"
    prefix = "far from the recorded values: of the future stress,"
    beyond = [f"{prefix} {text}" for text in reference.beyond(ahead)]
    return [*([missing] if names else []), *beyond]
