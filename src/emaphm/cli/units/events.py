"""Options of what makes events and of where these go, the same for `watch` and `serve`."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

if TYPE_CHECKING:
    from emaphm.monitoring.settings import PrognosisSettings

WebhookAddress = Annotated[
    str | None,
    Parameter(env_var="EMAPHM_WEBHOOK", help="Address that is sent each event by POST, as JSON."),
]


@Parameter(name="*")
@dataclass(frozen=True)
class FailureEvents:
    """From when on a remaining useful life makes an event."""

    horizon: Annotated[
        float,
        Parameter(help="Flight hours from now on, within which a probable failure makes an event [h]."),
    ] = 200.0
    risk: Annotated[
        float, Parameter(help="Probability of failure within the horizon from which an event is made.")
    ] = 0.05

    def settings(self) -> "PrognosisSettings":
        """Return the settings of prognoses and their events; `PrognosisError` where they cannot be."""
        from emaphm.monitoring import WATCH
        from emaphm.prognosis import Question

        Question(self.horizon, self.risk)  # refuses what cannot be
        return replace(WATCH.prognosis, horizon=self.horizon, risk=self.risk)
