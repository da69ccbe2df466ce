"""Figures of a study that compares methods."""

from emaphm.plotting.study.convergence import draw_convergence
from emaphm.plotting.study.costs import draw_costs
from emaphm.plotting.study.errors import draw_errors
from emaphm.plotting.study.ranks import draw_ranks
from emaphm.plotting.study.success import draw_success

__all__ = ["draw_convergence", "draw_costs", "draw_errors", "draw_ranks", "draw_success"]
