"""Hours and advice as text."""

import math

from emaphm.prognosis.advice import Advice, advice_in_words


def hours_text(hours: float) -> str:
    """Return hours as text; `inf` as words."""
    return f"{hours:,.0f} h" if math.isfinite(hours) else "no failure in sight"


def advice_text(given: Advice, now: float) -> str:
    """Return advice as a sentence with its risk; `now` are the unit's current flight hours [h]."""
    action = advice_in_words(given.to_dict(now))
    if given.hours == 0:
        return f"{action} ({given.reason})"
    # A risk of one path in many must not be shown as 0.
    risk = f"{100 * given.risk:{'.1g' if 0 < given.risk < 1e-3 else '.1f'}} %"
    return f"{action}, at a risk of {risk} ({given.reason})"
