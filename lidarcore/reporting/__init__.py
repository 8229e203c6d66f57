"""Reports as HTML pages that need nothing else: templates, tables and charts, coloured by one style sheet."""

from lidarcore.reporting.charts import WIDTH, Bar, Map, bars, chart, svg
from lidarcore.reporting.log_charts import boxes, curves
from lidarcore.reporting.page import (
    NOT_COMPARABLE,
    Agreement,
    bullets,
    columns,
    details,
    figure,
    page,
    paragraphs,
    table,
    verdicts,
)

__all__ = [
    "NOT_COMPARABLE",
    "WIDTH",
    "Agreement",
    "Bar",
    "Map",
    "bars",
    "boxes",
    "bullets",
    "chart",
    "columns",
    "curves",
    "details",
    "figure",
    "page",
    "paragraphs",
    "svg",
    "table",
    "verdicts",
]
