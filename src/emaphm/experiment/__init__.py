"""Design of a test before it is made: how well it will identify each fault, and a better excitation."""

from emaphm.experiment.design import design
from emaphm.experiment.result import Design

__all__ = ["Design", "design"]
