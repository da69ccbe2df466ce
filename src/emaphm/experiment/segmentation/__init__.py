"""A long recording cut into stretches that identify something."""

from emaphm.experiment.segmentation.result import Segment, Segments, check_folder
from emaphm.experiment.segmentation.segments import segments

__all__ = ["Segment", "Segments", "check_folder", "segments"]
