"""One diagnosis of several recordings of a unit."""

from emaphm.diagnosis.joint.diagnose import diagnose_joint
from emaphm.diagnosis.joint.result import JointDiagnosis, JointRecording

__all__ = ["JointDiagnosis", "JointRecording", "diagnose_joint"]
