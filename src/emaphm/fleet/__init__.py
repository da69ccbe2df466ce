"""Diagnosis of many recordings, each alone, on processes or a cluster; results are stored as they finish."""

from emaphm.fleet.batch import diagnose_all
from emaphm.fleet.result import BatchResult, batch_table
from emaphm.fleet.settings import DiagnosisSettings
from emaphm.fleet.sources import recording_files

__all__ = ["BatchResult", "DiagnosisSettings", "batch_table", "diagnose_all", "recording_files"]
