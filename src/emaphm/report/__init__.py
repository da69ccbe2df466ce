"""A diagnosis as one HTML page, to be kept, sent and printed."""

from emaphm.report.write import write_report

__all__ = ["write_report"]
