"""A report as one HTML file: the built page with the report's JSON in it."""

import html
from importlib.resources import files

from selfmodel.report.charts import Report, as_json

REPORT = "report.html"
"""File of the report in the folder of a run or of a campaign."""

TEMPLATE = "template.html"
"""The page: ``make page`` builds it from the folder ``report_page``."""

DATA, TITLE = "<!--selfmodel-report-data-->", "<!--selfmodel-report-title-->"
"""Places in the page for the JSON of the report and for its title."""


def html_of(report: Report) -> bytes:
    """Returns the HTML file of a report; it makes no network request."""
    page = (files("selfmodel.report") / TEMPLATE).read_text(encoding="utf-8")
    # The text of a script ends at "</script", and "<!--" changes how it is read.
    values = as_json(report).decode().replace("<", "\\u003c").replace("\u2028", "\\u2028")
    data = f'<script type="application/json" id="report">{values}</script>'
    head, _, rest = page.partition(TITLE)
    middle, _, tail = rest.partition(DATA)
    return f"{head}{html.escape(report.title)}{middle}{data}{tail}".encode()
