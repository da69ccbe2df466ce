"""A method that is compared in a study, with its settings."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from emaphm.actuator import NAMES
from emaphm.errors import StudyError
from emaphm.estimation.bias_correction import MAX_CORRECTIONS
from emaphm.estimation.methods import Method, method_named
from emaphm.fleet import DiagnosisSettings
from emaphm.study.rig import Label


class Contestant(BaseModel):
    """A method: its name, a label that distinguishes it from others of this name, and its settings.

    A method with least squares makes at most `max_corrections` bias corrections (`turns` is another name of
    this key), and estimates `nuisances` with the faults. By default, these are the default nuisances of
    `diagnose` for recordings of a rig, and none for recordings of the actuator as described. `estimator` is
    the file of an estimator (`emaphm train`) whose answer is the start of searches on recordings of a rig; if
    `fast`, the answer is returned without a search. Any other key is a setting of the optimiser, e.g.
    population or iterations.
    """

    model_config = ConfigDict(frozen=True, extra="allow")

    method: str
    label: Label
    max_corrections: Annotated[int, Field(ge=0, le=20)] = MAX_CORRECTIONS
    nuisances: tuple[str, ...] | None = None
    estimator: str | None = None
    fast: bool = False

    @model_validator(mode="before")
    @classmethod
    def _from_name(cls, values: Any) -> Any:
        if isinstance(values, str):
            values = {"method": values}
        if not isinstance(values, Mapping):
            return values
        values = dict(values)
        if "turns" in values:
            if "max_corrections" in values:
                raise StudyError("'turns' and 'max_corrections' are the same; give one of them")
            values["max_corrections"] = values.pop("turns")
        return {"label": values["method"], **values} if "method" in values else values

    @model_validator(mode="after")
    def _exists(self) -> Self:
        self.chosen()
        self.settings(0).check_estimator()
        return self

    def settings(self, seed: int) -> DiagnosisSettings:
        """Return the arguments of a diagnosis by this method."""
        return DiagnosisSettings(
            method=self.method,
            max_corrections=self.max_corrections,
            nuisances=self.nuisances,
            estimator=self.estimator,
            fast=self.fast,
            seed=seed,
        )

    @property
    def described(self) -> str:
        """Label, method and settings in one line."""
        settings = [
            f"{name} {value}"
            for name, value in (self.model_extra or {}).items()
            if name not in ("population", "iterations")
        ]
        method = self.chosen()
        if method.optimizer is not None:
            optimizer = method.optimizer(np.zeros(len(NAMES)), np.ones(len(NAMES)))
            settings = [f"{optimizer.population} × {optimizer.iterations}", *settings]
        if method.least_squares:
            settings.append(f"up to {self.max_corrections} corrections")
        if self.estimator is not None:
            settings.append(f"estimator {Path(self.estimator).name}{', alone' if self.fast else ''}")
        if self.nuisances is not None:
            settings.append(f"nuisances: {', '.join(self.nuisances) or 'none'}")
        return f"{self.label}: {', '.join([method.name, *settings])}"

    def chosen(self) -> Method:
        """Return the method with its settings; `MethodError` if the method or a setting is unknown."""
        return method_named(self.method, self.model_extra)
