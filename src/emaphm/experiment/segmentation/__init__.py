"""Segmentation of a long recording into stretches that identify faults."""

from emaphm.experiment.segmentation.result import Segment, Segments, check_folder
from emaphm.experiment.segmentation.segments import segments

__all__ = ["Segment", "Segments", "check_folder", "segments"]
