"""Content of a report as plain data, which the page draws: sections of charts and tables.

Every record is JSON as ``as_json`` writes it: an item has its ``kind``; numbers are those of the
logs and results, and NaN or infinite numbers are null.
"""

from collections.abc import Mapping
from typing import Any

import msgspec

FORMAT = "selfmodel-report-1"
"""Format of the JSON in the page."""

Cell = float | int | str | bool | None
"""Cell of a table; None if it is empty."""

Numbers = tuple[float, ...]


class Record(msgspec.Struct, frozen=True):
    """A part of an item."""


class Item(msgspec.Struct, frozen=True, tag_field="kind"):
    """What a section shows.

    Attributes:
        title: Title.
    """

    title: str


class Mark(Record, frozen=True):
    """A time or a value that a chart marks.

    Attributes:
        label: Text of the mark.
        value: Position on the horizontal axis.
        low: Lower bound of the position; None without an interval.
        high: Upper bound of the position.
    """

    label: str
    value: float
    low: float | None = None
    high: float | None = None


class Series(Record, frozen=True):
    """One line of a chart.

    Attributes:
        name: Name in the legend.
        x: Positions on the horizontal axis.
        y: Values, as many; NaN or None where unknown.
    """

    name: str
    x: Numbers
    y: tuple[float | None, ...]


class LineChart(Item, frozen=True, tag="line"):
    """Values over a horizontal axis; labels have the unit."""

    x_label: str
    y_label: str
    series: tuple[Series, ...]
    marks: tuple[Mark, ...] = ()


class Group(Record, frozen=True):
    """Bars with one label.

    Attributes:
        label: Label of the bars.
        values: Value of each bar, in the order of ``BarChart.names``; NaN where unknown.
    """

    label: str
    values: Numbers


class BarChart(Item, frozen=True, tag="bars"):
    """Horizontal bars in groups.

    Attributes:
        x_label: Label of the values, with their unit.
        names: Names of the bars of a group.
        groups: The groups.
    """

    x_label: str
    names: tuple[str, ...]
    groups: tuple[Group, ...]


class Estimate(Record, frozen=True):
    """A value with an interval.

    Attributes:
        label: Name of the quantity.
        value: Estimated value.
        low: Lower bound of the interval.
        high: Upper bound of the interval.
        note: Remark, such as ``not determined by these trials``.
    """

    label: str
    value: float
    low: float
    high: float
    note: str = ""


class IntervalChart(Item, frozen=True, tag="intervals"):
    """Values with intervals, one below the other.

    Attributes:
        x_label: Label of the values, with their unit.
        estimates: The values.
        reference: Value that is marked, such as 1 for factors; None without one.
        limits: Ends of the axis, such as 0 and 1 for shares; None for those of the values.
    """

    x_label: str
    estimates: tuple[Estimate, ...]
    reference: float | None = None
    limits: tuple[float, float] | None = None


class Row(Record, frozen=True):
    """A row of a heat map: its name, and its value in each column, NaN where unknown."""

    label: str
    values: Numbers


class HeatMap(Item, frozen=True, tag="heat"):
    """Values by row and time.

    Attributes:
        x_label: Label of the horizontal axis, with its unit.
        value_label: Label of the values, with their unit.
        begin: Beginning of each column on the horizontal axis.
        end: End of each column.
        rows: The rows.
        largest: Value with the strongest colour.
        marks: Marked positions on the horizontal axis.
    """

    x_label: str
    value_label: str
    begin: Numbers
    end: Numbers
    rows: tuple[Row, ...]
    largest: float
    marks: tuple[Mark, ...] = ()


class Lane(Record, frozen=True):
    """A lane of a gait diagram: name of the sensor, beginning and end of each contact, s."""

    label: str
    spans: tuple[tuple[float, float], ...]


class GaitDiagram(Item, frozen=True, tag="gait"):
    """Ground contacts over time: lanes by the name of the robot, and the end of the trial, s."""

    groups: Mapping[str, tuple[Lane, ...]]
    end: float


class Table(Item, frozen=True, tag="table"):
    """A table that the reader can sort; names of columns have the unit."""

    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]


class Picture(Item, frozen=True, tag="picture"):
    """A picture: media type, such as ``image/png``, and the file in base64."""

    media_type: str
    data: str


class Attachment(Item, frozen=True, tag="file"):
    """A file that the reader can save: its name, and the file in base64."""

    name: str
    data: str


class Section(Record, frozen=True):
    """A section of a report.

    Attributes:
        key: Identifier in the page, a word in lower case.
        title: Heading.
        text: Paragraphs before the items.
        items: Charts, tables and pictures, in order.
    """

    key: str
    title: str
    text: tuple[str, ...] = ()
    items: tuple[Item, ...] = ()


class Report(Record, frozen=True, kw_only=True):
    """A report.

    Attributes:
        title: Title of the page.
        headline: What happened, in one sentence.
        verdict: Further sentences about the result.
        sections: The sections, in order.
        scene: Robots on one timeline, ``scene.scene_of``; None without one.
        made_with: Versions by the name of the software.
    """

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
