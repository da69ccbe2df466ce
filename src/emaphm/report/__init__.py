"""Reports: of a diagnosis or prognosis (HTML), and of a study (HTML, Markdown and CSV)."""

from emaphm.report.write import write_report

__all__ = ["write_report"]
