"""What the report of a study says beside its figures and tables."""

from emaphm.study.analysis.ranks import SIGNIFICANT

COSTS = (
    "Mean error against what a run costs, in wall time and in evaluations (simulations of the model; a "
    "correction's runs of the reference model count in the time alone). The best stand at the lower left."
)

HOLLOW = " Hollow markers are the thesis's."

ERRORS = (
    "Error by case: a marker is the median of a method's runs, its line the middle half of them "
    "(quartiles). Further left is better; a long line is a method that depends on luck."
)

SUCCESS = (
    "Share of runs within 1, 2 and 5 % of error, dark to light. The dark end is what counts: runs "
    "whose faults can be taken at their word."
)

CONVERGENCE = (
    "Error (above) and fitness (below) of the best point so far against the evaluations spent: the "
    "median run, shaded its quartiles; a marker ends each method. A method without populations is its "
    "final marker alone. Where the fitness still falls and the error does not, the model's bias is "
    "what is left."
)

RANKS = (
    "Mean rank of each method, best above: 1 would be the least error in every run. A black bar at the "
    f"right joins methods that the pairwise tests below cannot tell apart (p > {SIGNIFICANT:g})."
)

TIME = (
    "Mean wall time of one run in seconds, while others ran beside it: for comparing methods within "
    "this study; alone on the machine a run may be faster."
)

TIME_THESIS = (
    " Ours / thesis. The thesis doubled its dragonfly's times, which had half the iterations, but for low K "
    "and the multiple faults."
)

PAIRS = (
    "p-value of each pair: how likely chance alone makes a difference as large (Wilcoxon's signed-rank "
    f"test, corrected for the number of pairs after Holm). {SIGNIFICANT:g} or less counts as a "
    "difference, in favour of the method with the lower mean rank."
)

HOPELESS = " With so few runs for so many pairs, not even a method that wins every run could be told apart."

RELIABILITY = (
    "RC = 1 - t err / Σ t err, with t the mean time and err the mean error over the single faults "
    "(thesis 6.4): 100 % is the best, and it depends on who takes part."
)

RELIABILITY_THESIS = (
    " The thesis's printed row does not follow from its own times and errors; what does follow stands "
    "beside it."
)

ERROR = (
    "The error is 100 times the root of the summed squared differences between the true and the found "
    "components, each on its scale from 0 to 1; the direction counts as much as there is eccentricity."
)

INTERVAL = (
    "The 95 % interval is that of the mean over further runs of these same cases (bootstrap within "
    "each case); it says nothing of other cases."
)

RANK = (
    "The tests compare runs of the same case and seed. They tell whether methods differ on these "
    "cases, not on all that an actuator may suffer."
)

THESIS = (
    "The thesis's figures were made with its own models, its own recordings and its own machine: they "
    "show what was reached then, and are no run of this study."
)
