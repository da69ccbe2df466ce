"""Plan of a synthetic fleet."""

from dataclasses import asdict, dataclass
from typing import Any

from emaphm.errors import ExecutionError, nearest
from emaphm.fleet.synthetic.population import POPULATIONS, Population

MOST_UNITS = 100_000
MOST_FLIGHTS = 10_000
LONGEST_INTERVAL_H = 10_000.0


@dataclass(frozen=True)
class FleetPlan:
    """Plan of a synthetic fleet: number of units, length of their histories, and population.

    Parameters
    ----------
    units
        Number of units.
    flights
        Largest number of check flights of a unit; each is recorded. There are none after a failure.
    interval
        Flight hours between check flights [h].
    seed
        Seed of the random streams.
    population
        Name in `POPULATIONS`.

    Raises
    ------
    ExecutionError
        A number is out of its range, or the population is unknown.
    """

    units: int = 10
    flights: int = 20
    interval: float = 80.0
    seed: int = 0
    population: str = "fleet"

    def __post_init__(self) -> None:
        for name, value, most in (("units", self.units, MOST_UNITS), ("flights", self.flights, MOST_FLIGHTS)):
            if not 1 <= value <= most:
                raise ExecutionError(f"{value} {name} cannot be simulated; give 1 to {most}")
        if not 0 < self.interval <= LONGEST_INTERVAL_H:
            raise ExecutionError(
                f"an interval of {self.interval:g} h between check flights cannot be simulated; give more "
                f"than 0, up to {LONGEST_INTERVAL_H:g}"
            )
        if self.seed < 0:
            raise ExecutionError(f"seed {self.seed} is negative; give 0 or more")
        if self.population not in POPULATIONS:
            raise ExecutionError(
                f"unknown population '{self.population}'{nearest(self.population, POPULATIONS)}"
            )

    @property
    def drawn_from(self) -> Population:
        """The population."""
        return POPULATIONS[self.population]

    def to_dict(self) -> dict[str, Any]:
        """Return the plan, ready for `json.dumps`."""
        return asdict(self)
