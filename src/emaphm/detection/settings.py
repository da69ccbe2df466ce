"""Settings of the detector."""

from dataclasses import dataclass


@dataclass(frozen=True)
class DetectorSettings:
    """Segments, statistics and thresholds of the detector.

    Attributes
    ----------
    false_alarm_rate
        Probability that a further healthy cycle, or run, is called not like healthy. With 0.01 and one cycle
        a day, there is a false alarm in three months.
    confidence
        Confidence of the bound on the rate of false alarms that the runs left out show.
    first_segment, growth
        Length of the first segment after a change of the command's direction, as a share of the manoeuvre,
        and ratio of the lengths of successive segments. Lost motion appears after reversals, friction during
        settling and steady motion. More segments locate a deviation better, but their covariance needs more
        healthy cycles: with equal segments of a twelfth, half as many single cycles of the Cranfield rig's
        backlash are detected.
    fewest_rows
        Least number of rows of a segment.
    fewest_rows_of_shape
        Least number of rows for which scatter and roughness are features; with fewer, only the mean is one.
    variance_share
        Share of the healthy variance in the directions of T²; the other directions are those of Q.
    fewest_runs, fewest_runs_of_load
        Least number of independent healthy runs of a manoeuvre, and of each of its loads. With fewer,
        Student's quantile, and with it the threshold, becomes very large.
    most_folds
        Largest number of folds of the cross-validation; with no more runs than this, each run is a fold.
    command_tolerance
        Largest rms difference of two commands of one manoeuvre, as a share of the command's range.
    load_tolerance
        Largest rms difference of two recordings of one load, as a share of the largest learned load.
    rows_tolerance
        Largest relative difference in rows, and in sample rate, of cycles of one manoeuvre, and the largest
        shift of their beginnings as a share of the rows.
    drift_directions, drift_significance
        Number of principal directions in which healthy runs are tested for a drift with their order, and
        significance of all these tests together; also that of the test for serial correlation of the runs.
    alike
        Least share of a squared deviation, less the mean contribution of healthy scatter, along a seeded
        fault's direction for the fault to be named.

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
