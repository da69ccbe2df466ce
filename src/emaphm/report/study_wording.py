"""Texts of the report of a study: captions of figures and explanations of tables."""

from emaphm.study.analysis.ranks import SIGNIFICANT

COSTS = (
    "Mean error against the cost of one run: wall time, and evaluations (simulations of the model; runs of "
    "the reference model for the bias correction count in the time only). Best is the lower left."
)

HOLLOW = " Hollow markers: values printed in the thesis."

ERRORS = (
    "Error by case. Marker: median of a method's runs; line: from the lower to the upper quartile. Further "
    "left is better; a long line means that the result depends on the random numbers of the run."
)

SUCCESS = (
    "Percentage of runs with an error of at most 1, 2 and 5 %, from dark to light. The longer the dark bar, "
    "the more runs give the faults accurately."
)

CONVERGENCE = (
    "Error (above) and fitness (below) of the best candidate so far, against evaluations: median and "
    "quartiles of the runs. A marker ends each method; one without populations has its final marker only. "
    "Where the fitness still falls but the error does not, the remaining error is the bias of the model."
)

RANKS = (
    "Mean rank of each method, best at the top; rank 1: least error in every run. A black bar at the right "
    f"joins methods that do not differ significantly in the pairwise tests below (p > {SIGNIFICANT:g})."
)

TIME = (
    "Mean wall time of one run in seconds, measured while other runs used the same machine: it compares "
    "methods within this study. A run alone on the machine may be faster."
)

TIME_THESIS = (
    " Shown as this study / thesis. The thesis doubled the times of its dragonfly runs, which had half the "
    "iterations, except for low K and the multiple faults."
)

PAIRS = (
    "p-value of each pair of methods: the probability of a difference at least this large by chance "
    "(Wilcoxon's signed-rank test with Holm's correction for the number of pairs). A difference is "
    f"significant if p is {SIGNIFICANT:g} or less; the method with the lower mean rank is then better."
)

HOPELESS = " With so few runs no difference can be significant, even for a method that always wins."

RELIABILITY = (
    "RC = 1 - t err / Σ t err, with the mean time t and the mean error err over the single faults "
    "(thesis 6.4). 100 % is best. The value depends on which methods are compared."
)

RELIABILITY_THESIS = (
    " The printed values of the thesis do not follow from its own times and errors; the recomputed ones do."
)

ERROR = (
    "Error: 100 times the root of the summed squared differences between true and estimated components, each "
    "on its scale from 0 to 1; the direction is weighted with the eccentricity."
)

INTERVAL = (
    "95 % interval: of the mean over further runs of the same cases (bootstrap within each case). It does "
    "not cover other cases."
)

RANK = (
    "Tests: they compare runs of the same case and seed. They show whether methods differ on these cases, "
    "not on all possible faults."
)

THESIS = (
    "Thesis: its values come from its own models, recordings and computer. They are no runs of this study."
)
