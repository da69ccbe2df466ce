"""Options of what makes events and of where these go, the same for `watch` and `serve`."""

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

if TYPE_CHECKING:
    from emaphm.monitoring.settings import PrognosisSettings

Horizon = Annotated[
    float, Parameter(help="Flight hours from now on, within which a probable failure makes an event [h].")
]
Risk = Annotated[
    float, Parameter(help="Probability of failure within the horizon from which an event is made.")
]
WebhookAddress = Annotated[
    str | None,
    Parameter(env_var="EMAPHM_WEBHOOK", help="Address that is sent each event by POST, as JSON."),
]


def prognosis_settings(horizon: float, risk: float) -> "PrognosisSettings":
    """Return the settings of prognoses and their events; `PrognosisError` where they cannot be."""
    from emaphm.monitoring import WATCH
    from emaphm.prognosis import Question

    Question(horizon, risk)  # refuses what cannot be
    return replace(WATCH.prognosis, horizon=horizon, risk=risk)
