"""A diagnosis for people and for programs: one HTML file that needs nothing else, and the same as JSON."""

from wingfit.report.finding_file import finding_from_json, finding_json
from wingfit.report.page import html

__all__ = ["finding_from_json", "finding_json", "html"]
