"""Result of inverse dynamics: parameters with standard errors, and the torques of each recording."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from emaphm.actuator import Actuator
from emaphm.actuator.actuator import described_parts
from emaphm.actuator.lumped_parameters import PARTS, with_lumped_parameters
from emaphm.arrays import Array
from emaphm.estimation.inverse_dynamics.filtering import FilterFrequencies
from emaphm.estimation.uncertainty.collinearity import CollinearSet
from emaphm.text_table import format_table

LAWS = ("friction", "weight")
"""Sections to which a parameter that is not described is added."""


@dataclass(frozen=True)
class ParameterEstimate:
    """A parameter with its standard error, both in `unit`."""

    value: float
    standard_error: float
    unit: str


@dataclass(frozen=True, eq=False)
class ForceReplay:
    """The recorded torque of a recording, and the torque that its measured motion requires.

    `time` [s], `measured` and `predicted` torque of the motor [N·m] have the shape (rows,), the rows of the
    regression; `relative_error` is rms(measured - predicted) / rms(measured) of the compared `channel`.
    `values` are the parameters that were estimated for this recording alone or known for it. `still_rows` is
    the number of recorded rows below the speed `still_speed` [rad/s].
    """

    source: str
    channel: str
    frequencies: FilterFrequencies
    still_speed: float
    still_rows: int
    time: Array
    measured: Array
    predicted: Array
    relative_error: float
    values: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class InverseDynamicsResult:
    """Parameters that explain the torque of measured motion, from one fit of all recordings.

    `covariance` (p, p) is that of the shared `parameters` in their order and units. `relative_error` is that
    of all rows of the regression. `collinear` are sets of parameters that are identified only in combination;
    `at_bound` are parameters at a bound of the search, which the recordings do not identify.
    `error_correlation` is the correlation of the residuals of recordings that repeat a motion, from 0 to 1;
    None if it is not significant.
    """

    parameters: Mapping[str, ParameterEstimate]
    covariance: Array
    residual: Array
    relative_error: float
    replays: tuple[ForceReplay, ...]
    collinear: tuple[CollinearSet, ...]
    at_bound: tuple[str, ...]
    actuator: Actuator
    error_correlation: float | None = None

    @property
    def values(self) -> dict[str, float]:
        """The estimated values by name."""
        return {name: estimate.value for name, estimate in self.parameters.items()}

    @property
    def standard_errors(self) -> dict[str, float]:
        """The standard errors by name, which allow for correlated residuals."""
        return {name: estimate.standard_error for name, estimate in self.parameters.items()}

    @property
    def identified(self) -> Actuator:
        """The actuator with the estimated values, for example as the start of a simulated fit.

        Raises
        ------
        ActuatorError
            A value is impossible, for example an inertia that is not positive.
        """
        return with_parameters(self.actuator, self.values)

    def to_dict(self) -> dict[str, Any]:
        """Return the result without its series, for JSON."""
        return {
            "parameters": {
                name: {"value": p.value, "standard_error": p.standard_error, "unit": p.unit}
                for name, p in self.parameters.items()
            },
            "relative_error": self.relative_error,
            "collinear": [list(collinear.members) for collinear in self.collinear],
            "at_bound": list(self.at_bound),
            "error_correlation": self.error_correlation,
            "recordings": [
                {
                    "recording": replay.source,
                    "channel": replay.channel,
                    "relative_error": replay.relative_error,
                    "position_hz": replay.frequencies.position_hz,
                    "regression_hz": replay.frequencies.regression_hz,
                    "rows": replay.time.size,
                    "still_rows": replay.still_rows,
                    "values": dict(replay.values),
                }
                for replay in self.replays
            ],
        }

    def to_json(self) -> str:
        """Return the result without its series as JSON."""
        return json.dumps(self.to_dict(), indent=2)

    def __str__(self) -> str:
        """Return tables of the parameters and of the recordings, and notes on unidentified parameters."""
        rows = [
            (name, f"{p.value:.6g}", f"{p.standard_error:.2g}", p.unit) for name, p in self.parameters.items()
        ]
        table = format_table(("parameter", "value", "std. error", "unit"), rows)
        recordings = [
            (
                replay.source,
                replay.channel,
                f"{100 * replay.relative_error:.4g} %",
                f"{replay.frequencies.position_hz:.3g} Hz",
                f"{replay.frequencies.regression_hz:.3g} Hz",
            )
            for replay in self.replays
        ]
        header = ("recording", "channel", "relative error", "position to", "regression to")
        notes = [str(collinear) for collinear in self.collinear]
        notes += [
            f"'{name}' ended at the bound of its search: the recordings do not identify it."
            for name in self.at_bound
        ]
        return "\n\n".join([table, format_table(header, recordings), *notes])


def with_parameters(actuator: Actuator, values: Mapping[str, float]) -> Actuator:
    """Return `actuator` with the lumped parameters `values`, and with the laws that these belong to."""
    description = actuator.model_dump(exclude_none=True)
    for name, value in values.items():
        if described_parts(actuator, name) is None and PARTS[name][0] in LAWS:
            description.setdefault(PARTS[name][0], {})[name] = value
    return with_lumped_parameters(Actuator.from_dict(description, where=actuator.name), values)
