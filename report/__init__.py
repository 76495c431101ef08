"""Write the finding of a diagnosis as a report (one self-contained HTML file) and as JSON."""

from wingfit.report.finding_file import finding_from_json, finding_json
from wingfit.report.page import html

__all__ = ["finding_from_json", "finding_json", "html"]
