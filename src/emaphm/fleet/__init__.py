"""Batches of recordings: each is diagnosed separately, on processes or a cluster, and stored at once."""

from emaphm.fleet.batch import diagnose_all
from emaphm.fleet.result import BatchResult, batch_table
from emaphm.fleet.settings import DiagnosisSettings
from emaphm.fleet.sources import recording_files

__all__ = ["BatchResult", "DiagnosisSettings", "batch_table", "diagnose_all", "recording_files"]
