"""What tunes the detector, in one place."""

from dataclasses import dataclass


@dataclass(frozen=True)
class DetectorSettings:
    """Segments, statistics and thresholds of the detector.

    Attributes
    ----------
    false_alarm_rate
        Share of further healthy cycles, or runs, that may be called not like healthy. An owner who looks at
        a cycle a day has one false alarm in three months.
    confidence
        Of the bound on the rate that the runs left out can show.
    first_segment, growth
        Length of the first segment after a change of the command's direction, as a share of the manoeuvre,
        and how many times as long the next is: reversals show lost motion, settling and steady motion show
        friction. More segments say better where, but their covariance needs more healthy cycles: equal ones
        of a twelfth detect half as many single cycles of the Cranfield rig's backlash.
    fewest_rows
        Rows of a segment at least.
    fewest_rows_of_shape
        Rows from which on scatter and roughness are features; of fewer, only the mean is known.
    variance_share
        Share of the healthy variance whose directions make up T²; the others make up Q.
    fewest_runs, fewest_runs_of_load
        Independent healthy runs of a manoeuvre, and of each of its loads: Student's quantile of the threshold
        grows without bound below.
    most_folds
        Folds of the cross-validation at most; each run is left out in turn where there are no more runs.
    command_tolerance
        Largest rms difference of two commands of one manoeuvre, as a share of the command's range.
    load_tolerance
        Largest rms difference of two loads that count as one, as a share of the largest load learned.
    rows_tolerance
        Largest relative difference in rows, and in sample rate, of cycles of one manoeuvre, and the share of
        its rows by which they may begin earlier or later.
    drift_directions, drift_significance
        Principal directions in which healthy runs are tested for a drift with their order, and the
        significance of all tests together; also of the test whether runs resemble those before them.
    alike
        Share of a deviation, less what healthy scatter adds to its square, that must lie along a seeded
        fault's direction to be called alike: half.

    `python examples/cranfield/cranfield.py` measures detections and false alarms on a rig.
    """

    false_alarm_rate: float = 0.01
    confidence: float = 0.95
    first_segment: float = 1 / 80
    growth: int = 4
    fewest_rows: int = 4
    fewest_rows_of_shape: int = 8
    variance_share: float = 0.8
    fewest_runs: int = 5
    fewest_runs_of_load: int = 3
    most_folds: int = 30
    command_tolerance: float = 0.02
    load_tolerance: float = 0.05
    rows_tolerance: float = 0.01
    drift_directions: int = 3
    drift_significance: float = 0.01
    alike: float = 0.5


DETECTOR = DetectorSettings()
