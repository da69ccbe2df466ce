"""How far a parameter may be from its description: widths of the start and bounds, by the logarithm."""

import math

import numpy as np
import pytest

from emaphm.actuator.lumped_parameters import lumped_parameters
from emaphm.estimation.space.nuisances import NuisanceSet
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.estimation.space.parameter_variation import ParameterVariation, start_widths, varied
from strategies import EVERYTHING

WIDE = (
    "stiffness",
    "stribeck_speed",
    "presliding_stiffness",
    "presliding_damping",
    "current_lag",
    "source_resistance",
    "voltage_drop",
)
NARROW = ("inertia", "static", "damping", "quadratic", "load_friction")


def test_what_no_description_implies_is_sought_from_a_twentieth_to_twenty_times() -> None:
    found = ParameterVariation.suspected(EVERYTHING, (*WIDE, *NARROW))
    np.testing.assert_allclose(np.exp(found.priors), [20.0] * len(WIDE) + [3.0] * len(NARROW))
    np.testing.assert_allclose(np.exp(found.widest), 30.0)
    np.testing.assert_array_equal(start_widths((*WIDE, *NARROW)), found.priors)


def test_a_free_parameter_is_as_wide_as_its_bound() -> None:
    found = ParameterVariation.free(EVERYTHING, (*WIDE, *NARROW))
    np.testing.assert_array_equal(found.priors, found.widest)


@pytest.mark.parametrize(("name", "deviations"), [*((name, None) for name in WIDE), ("inertia", 2.0537489)])
def test_the_starts_of_a_search_are_spread_by_the_width_within_the_bounds(
    name: str, deviations: float | None
) -> None:
    chosen = NuisanceSet.of(EVERYTHING, (), (), ParameterVariation.suspected(EVERYTHING, (name,)))
    space = ParameterSpace.of(EVERYTHING, chosen)
    unit = np.full((4, space.dimensions), 0.5)
    unit[:, -1] = 0.0, 0.5, 0.69146246, 1.0
    [values] = chosen.values(space.prior_transform(unit)[:, -1:]).values()
    reached = varied(EVERYTHING, name, values) / lumped_parameters(EVERYTHING, (name,))[name]
    # A normal distribution: 0.5 standard deviations above the median are 69.1 %; 98 % are the largest tried.
    largest = 30.0 if deviations is None else 3.0**deviations
    half = math.sqrt(20.0 if deviations is None else 3.0)
    np.testing.assert_allclose(reached, [1 / largest, 1.0, half, largest], rtol=1e-6)
