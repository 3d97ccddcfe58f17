"""Stage 5: one HTML page with its figures, drawn from what the lake holds."""

from pipelines.report.stage import report

__all__ = ["report"]
