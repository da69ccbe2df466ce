"""What a test or a stretch of a flight will identify: design of tests, segmentation of recordings."""

from emaphm.experiment.design import design
from emaphm.experiment.result import Design
from emaphm.experiment.segmentation import Segment, Segments, segments

__all__ = ["Design", "Segment", "Segments", "design", "segments"]
