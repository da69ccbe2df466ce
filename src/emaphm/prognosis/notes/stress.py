"""Notes on a stress to come that the history does not allow to use, or only in part."""

from emaphm.prognosis.stress import STRESSES, Stress, StressReference


def stress_notes(ahead: Stress | None, reference: StressReference | None) -> list[str]:
    """Return notes on what of the stress `ahead` is not used, or only in part, for want of records."""
    if ahead is None:
        return []
    reference = reference or StressReference()
    known = reference.values
    names = [
        name
        for name, value, middle in zip(STRESSES, ahead.values, known, strict=True)
        if value is not None and middle is None
    ]
    missing = f"not recorded in the history, so not used of the stress to come: {', '.join(names)}"
    far = "far from what was recorded: of the stress to come,"
    beyond = [f"{far} {text}" for text in reference.beyond(ahead)]
    return [*([missing] if names else []), *beyond]
