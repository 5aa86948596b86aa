"""A report as one HTML file: the built page with the report's JSON in it."""

import html
import json
from importlib.resources import files

from selfmodel.errors import InputError
from selfmodel.files import encodable
from selfmodel.report.document import Report, as_json

TEMPLATE = "template.html"
"""Built page, package data: ``make page`` builds it from the folder ``report_page``."""

DATA = "<!--selfmodel-report-data-->"
TITLE = "<!--selfmodel-report-title-->"
"""Places in the page for the JSON of the report and for its title."""


def template() -> str:
    """Returns the built page.

    Raises:
        InputError: The page was not built, as in a checkout without Node.js.
    """
    file = files("selfmodel.report") / TEMPLATE
    if not file.is_file():
        raise InputError(
            f"selfmodel/report/{TEMPLATE}: expected the built page of a report, and it is missing: "
            f"run `make page` in a checkout (it needs Node.js 20 or newer), or install a wheel"
        )
    return file.read_text(encoding="utf-8")


def html_of(report: Report) -> bytes:
    """Returns the HTML file of a report; it makes no network request.

    Raises:
        InputError: The page was not built.
    """
    page = template()
    values = json.dumps(as_json(report), allow_nan=False, separators=(",", ":"))
    # The text of a script ends at "</script", and "<!--" changes how it is read.
    values = values.replace("<", "\\u003c").replace("\u2028", "\\u2028")
    data = f'<script type="application/json" id="report">{values}</script>'
    head, _, rest = page.partition(TITLE)
    middle, _, tail = rest.partition(DATA)
    title = html.escape(encodable(report.title))
    return f"{head}{title}{middle}{data}{tail}".encode()
