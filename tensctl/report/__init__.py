"""What is shown: one self-contained HTML file with tables, plots and a 3-D animation."""

from tensctl.report.case import Case, Check, Height, Limits, MpcCheck, Push, Wanted
from tensctl.report.page import write_report

__all__ = ["Case", "Check", "Height", "Limits", "MpcCheck", "Push", "Wanted", "write_report"]
