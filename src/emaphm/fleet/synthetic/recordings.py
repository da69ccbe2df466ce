"""Recordings of check flights of a synthetic unit, simulated with the reference model."""

import numpy as np

from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.actuator.requirements import Requirement
from emaphm.estimation.space.nuisances import COPPER, MAGNETS
from emaphm.fleet.synthetic.plan import FleetPlan
from emaphm.fleet.synthetic.population import CheckFlightRig, Population
from emaphm.fleet.synthetic.unit import FALLING, SyntheticUnit
from emaphm.random_streams import child_seed, stream
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

CHANNELS = ("time_s", "command_rad", "current_A", "voltage_V")

PART_NUMBER = "SYNTHETIC"


def fleet_actuator(population: Population) -> Actuator:
    """Return the actuator of a synthetic fleet: that of the thesis, with limits of its levels."""
    thesis = Actuator.thesis()
    required = []
    for name, wear in population.wear.items():
        healthy = getattr(Faults(), name)
        if name in FALLING:
            required.append(Requirement.model_validate({"component": name, "at_least": healthy - wear.limit}))
        else:
            required.append(Requirement.model_validate({"component": name, "at_most": wear.limit}))
    return thesis.model_copy(update={"name": PART_NUMBER, "requirements": tuple(required)})


def check_flight(
    unit: SyntheticUnit, hours: float, plan: FleetPlan, actuator: Actuator, number: int
) -> Recording:
    """Return the recording of the unit's `number`-th check flight, at flight `hours` [h].

    The model is the reference model, which is not the fitted model of a diagnosis. Load, temperature and
    supply are drawn for the flight and not recorded; only the line voltage depends on the supply.
    """
    population = plan.drawn_from
    rig = population.rig
    name = ("synthetic check flight", population.name, unit.serial_number, number)
    present = _with_flight_conditions(actuator, unit, population, rig, stream(plan.seed, *name))
    simulated = simulate(
        present,
        Chirp(rig.amplitude, 0.0, rig.stop_hz, rig.duration),
        faults=Faults.from_vector(unit.vectors[unit.row(hours)]),
        duration=rig.duration,
        sample_rate=rig.sample_rate,
        noise=rig.noise,
        adc_bits=rig.adc_bits,
        seed=child_seed(plan.seed, *name),
    )
    labels: dict[str, float | str] = {"serial": unit.serial_number, "hours": hours, "origin": "synthetic"}
    return Recording(
        {channel: simulated[channel] for channel in CHANNELS},
        source=f"synthetic, {unit.serial_number} at {hours:g} h",
        labels=labels,
    )


def _with_flight_conditions(
    actuator: Actuator,
    unit: SyntheticUnit,
    population: Population,
    rig: CheckFlightRig,
    random: np.random.Generator,
) -> Actuator:
    """Return the actuator with drawn load, temperature and supply of one flight."""
    load, heat, supply = random.uniform(-1, 1, 3) * (rig.load, rig.heat, rig.supply)
    temperature_rise = unit.mission[0] + population.stress.flight_K * random.standard_normal() + heat
    nominal = lumped_parameters(actuator, ("offset", "resistance", "torque_constant", "supply"))
    return with_lumped_parameters(
        actuator,
        {
            "offset": nominal["offset"] + load,
            "resistance": nominal["resistance"] * (1 + COPPER * temperature_rise),
            "torque_constant": nominal["torque_constant"] * (1 + MAGNETS * temperature_rise),
            "supply": nominal["supply"] * (1 + supply),
        },
    )
