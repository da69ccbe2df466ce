"""Options on events and their receiver, shared by `watch` and `serve`."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

if TYPE_CHECKING:
    from emaphm.monitoring.settings import PrognosisSettings

WebhookAddress = Annotated[
    str | None,
    Parameter(env_var="EMAPHM_WEBHOOK", help="URL to which each event is sent as JSON by an HTTP POST."),
]


@Parameter(name="*")
@dataclass(frozen=True)
class FailureEvents:
    """Conditions under which a prognosis raises an event."""

    horizon: Annotated[
        float,
        Parameter(help="Flight hours from now on for which the probability of failure is computed [h]."),
    ] = 200.0
    risk: Annotated[
        float,
        Parameter(help="Probability of failure within --horizon from which an event is raised, 0 to 1."),
    ] = 0.05

    def settings(self) -> "PrognosisSettings":
        """Return the settings of prognoses and their events; `PrognosisError` if they are invalid."""
        from emaphm.monitoring import WATCH
        from emaphm.prognosis import Question

        Question(self.horizon, self.risk)  # refuses invalid values
        return replace(WATCH.prognosis, horizon=self.horizon, risk=self.risk)
