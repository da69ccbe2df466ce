"""Design of tests, and segmentation of recordings, by the expected precision of each fault."""

from emaphm.experiment.design import design
from emaphm.experiment.result import Design
from emaphm.experiment.segmentation import Segment, Segments, segments

__all__ = ["Design", "Segment", "Segments", "design", "segments"]
