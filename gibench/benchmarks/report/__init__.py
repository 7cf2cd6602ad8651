"""Reports of runs: CSV files, the tables of the papers, plots, and a page that opens from disk."""

from gibench.benchmarks.report.source import ReportError as ReportError
from gibench.benchmarks.report.source import ReportSource as ReportSource
from gibench.benchmarks.report.write import write_report as write_report
