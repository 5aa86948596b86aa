"""A report as plain data, which the page draws: sections of charts and tables; and its HTML file.

Every record is JSON as ``as_json`` writes it: an item has its ``kind``; numbers are those of the
logs and results, and NaN or infinite numbers are null. Labels have the unit.
"""

import html
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any, Self

import msgspec

FORMAT = "selfmodel-report-1"
"""Format of the JSON in the page."""

REPORT = "report.html"
"""File of the report in the folder of a run or of a campaign."""

TEMPLATE = "template.html"
"""The page: ``make page`` builds it from the folder ``report_page``."""

DATA, TITLE = "<!--selfmodel-report-data-->", "<!--selfmodel-report-title-->"
"""Places in the page for the JSON of the report and for its title."""

Cell = float | int | str | bool | None
"""Cell of a table; None if it is empty."""

Numbers = tuple[float, ...]


class Item(msgspec.Struct, frozen=True, tag_field="kind"):
    """What a section shows, under a title."""

    title: str


class Mark(msgspec.Struct, frozen=True):
    """A position on the horizontal axis that a chart marks; bounds are None without an interval."""

    label: str
    value: float
    low: float | None = None
    high: float | None = None


class Series(msgspec.Struct, frozen=True):
    """One line of a chart; ``y`` is NaN or None where unknown."""

    name: str
    x: Numbers
    y: tuple[float | None, ...]


class LineChart(Item, frozen=True, tag="line"):
    """Values over a horizontal axis."""

    x_label: str
    y_label: str
    series: tuple[Series, ...]
    marks: tuple[Mark, ...] = ()


class Group(msgspec.Struct, frozen=True):
    """Values with one label, NaN where unknown: bars, or a row of a heat map.

    A bar with a note, such as ``fell in 1 of 3``, is hatched.
    """

    label: str
    values: Numbers
    notes: tuple[str, ...] = ()


class BarChart(Item, frozen=True, tag="bars"):
    """Horizontal bars in groups; ``names`` are those of the bars of a group, in order."""

    x_label: str
    names: tuple[str, ...]
    groups: tuple[Group, ...]


class Estimate(msgspec.Struct, frozen=True):
    """A value with an interval and a remark, such as ``not determined by these trials``."""

    label: str
    value: float
    low: float
    high: float
    note: str = ""


class IntervalChart(Item, frozen=True, tag="intervals"):
    """Values with intervals, one below the other, with a marked value and ends of the axis.

    An end is NaN without an interval.
    """

    x_label: str
    estimates: tuple[Estimate, ...]
    reference: float | None = None
    limits: tuple[float, float] | None = None


class HeatMap(Item, frozen=True, tag="heat"):
    """Values by row and column; ``largest`` has the strongest colour, columns begin and end."""

    x_label: str
    value_label: str
    begin: Numbers
    end: Numbers
    rows: tuple[Group, ...]
    largest: float
    marks: tuple[Mark, ...] = ()


class Lane(msgspec.Struct, frozen=True):
    """A lane of a gait diagram: name of the sensor, beginning and end of each contact, s."""

    label: str
    spans: tuple[tuple[float, float], ...]


class GaitDiagram(Item, frozen=True, tag="gait"):
    """Ground contacts over time: lanes by the name of the robot, and the end of the trial, s."""

    groups: Mapping[str, tuple[Lane, ...]]
    end: float


class Table(Item, frozen=True, tag="table"):
    """A table that the reader can sort."""

    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]

    @classmethod
    def of(cls, title: str, records: Sequence[Mapping[str, Cell]]) -> Self:
        """Returns the table of records, whose keys are its columns."""
        columns = tuple(dict.fromkeys(key for record in records for key in record))
        return cls(title, columns, tuple(tuple(map(one.get, columns)) for one in records))


class Picture(Item, frozen=True, tag="picture"):
    """A picture: media type, such as ``image/png``, and the file, base64 in JSON."""

    media_type: str
    data: bytes


class Attachment(Item, frozen=True, tag="file"):
    """A file that the reader can save: its name and content, base64 in JSON."""

    name: str
    data: bytes


class Section(msgspec.Struct, frozen=True):
    """A section: an identifier in lower case, a heading, paragraphs, then charts and tables."""

    key: str
    title: str
    text: tuple[str, ...] = ()
    items: tuple[Item, ...] = ()


class Report(msgspec.Struct, frozen=True, kw_only=True):
    """A report: a headline, further sentences, sections, ``scene_of`` robots, and versions."""

    format: str = FORMAT
    title: str
    headline: str
    verdict: tuple[str, ...] = ()
    sections: tuple[Section, ...] = ()
    scene: Mapping[str, Any] | None = None
    made_with: Mapping[str, str] = {}  # a struct copies it


def as_json(report: Report) -> bytes:
    """Returns the JSON of a report; a number that is not finite is null."""
    return msgspec.json.encode(report, enc_hook=dict)  # a read-only mapping


def html_of(report: Report) -> bytes:
    """Returns the HTML file of a report; it makes no network request."""
    page = (files("selfmodel.report") / TEMPLATE).read_text(encoding="utf-8")
    # The text of a script ends at "</script", and "<!--" changes how it is read.
    values = as_json(report).decode().replace("<", "\\u003c").replace("\u2028", "\\u2028")
    data = f'<script type="application/json" id="report">{values}</script>'
    head, _, rest = page.partition(TITLE)
    middle, _, tail = rest.partition(DATA)
    return f"{head}{html.escape(report.title)}{middle}{data}{tail}".encode()
