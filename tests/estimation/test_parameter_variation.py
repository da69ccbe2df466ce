"""The range of a parameter about its description: widths of starts, and bounds, as logarithms."""

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


def test_suspected_parameters_have_priors_of_a_factor_of_20_or_3() -> None:
    variation = ParameterVariation.suspected(EVERYTHING, (*WIDE, *NARROW))
    np.testing.assert_allclose(np.exp(variation.priors), [20.0] * len(WIDE) + [3.0] * len(NARROW))
    np.testing.assert_allclose(np.exp(variation.widest), 30.0)
    np.testing.assert_array_equal(start_widths((*WIDE, *NARROW)), variation.priors)


def test_a_free_parameter_has_a_prior_as_wide_as_its_bound() -> None:
    variation = ParameterVariation.free(EVERYTHING, (*WIDE, *NARROW))
    np.testing.assert_array_equal(variation.priors, variation.widest)


@pytest.mark.parametrize(("name", "deviations"), [*((name, None) for name in WIDE), ("inertia", 2.0537489)])
def test_starts_of_a_search_have_a_log_normal_distribution_cut_at_the_bounds(
    name: str, deviations: float | None
) -> None:
    chosen = NuisanceSet.of(EVERYTHING, (), (), ParameterVariation.suspected(EVERYTHING, (name,)))
    space = ParameterSpace.of(EVERYTHING, chosen)
    unit = np.full((4, space.dimensions), 0.5)
    unit[:, -1] = 0.0, 0.5, 0.69146246, 1.0
    [values] = chosen.values(space.prior_transform(unit)[:, -1:]).values()
    reached = varied(EVERYTHING, name, values) / lumped_parameters(EVERYTHING, (name,))[name]
    # A normal distribution: its 69.1 % quantile is 0.5 standard deviations; it is cut at its 98 % quantile.
    largest = 30.0 if deviations is None else 3.0**deviations
    half = math.sqrt(20.0 if deviations is None else 3.0)
    np.testing.assert_allclose(reached, [1 / largest, 1.0, half, largest], rtol=1e-6)
