"""Charts, tables and pictures of a report: plain data, which the page draws."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class Mark:
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


@dataclass(frozen=True)
class Series:
    """One line of a chart.

    Attributes:
        name: Name in the legend.
        x: Positions on the horizontal axis.
        y: Values, as many; NaN where unknown.
    """

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]


@dataclass(frozen=True)
class LineChart:
    """Values over a horizontal axis.

    Attributes:
        title: Title.
        x_label: Label of the horizontal axis, with its unit.
        y_label: Label of the vertical axis, with its unit.
        series: The lines.
        marks: Marked positions on the horizontal axis.
    """

    KIND: ClassVar[str] = "line"
    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    marks: tuple[Mark, ...] = ()


@dataclass(frozen=True)
class Group:
    """Bars with one label.

    Attributes:
        label: Label of the bars.
        values: Value of each bar, in the order of ``BarChart.names``; NaN where unknown.
    """

    label: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class BarChart:
    """Horizontal bars in groups.

    Attributes:
        title: Title.
        x_label: Label of the values, with their unit.
        names: Names of the bars of a group.
        groups: The groups.
    """

    KIND: ClassVar[str] = "bars"
    title: str
    x_label: str
    names: tuple[str, ...]
    groups: tuple[Group, ...]


@dataclass(frozen=True)
class Estimate:
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


@dataclass(frozen=True)
class IntervalChart:
    """Values with intervals, one below the other.

    Attributes:
        title: Title.
        x_label: Label of the values, with their unit.
        estimates: The values.
        reference: Value that is marked, such as 1 for factors; None without one.
        limits: Ends of the axis, such as 0 and 1 for shares; None for those of the values.
    """

    KIND: ClassVar[str] = "intervals"
    title: str
    x_label: str
    estimates: tuple[Estimate, ...]
    reference: float | None = None
    limits: tuple[float, float] | None = None


@dataclass(frozen=True)
class Row:
    """A row of a heat map.

    Attributes:
        label: Name of the row.
        values: Value in each column; NaN where unknown.
    """

    label: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class HeatMap:
    """Values by row and time.

    Attributes:
        title: Title.
        x_label: Label of the horizontal axis, with its unit.
        value_label: Label of the values, with their unit.
        begin: Beginning of each column on the horizontal axis.
        end: End of each column.
        rows: The rows.
        largest: Value with the strongest colour.
        marks: Marked positions on the horizontal axis.
    """

    KIND: ClassVar[str] = "heat"
    title: str
    x_label: str
    value_label: str
    begin: tuple[float, ...]
    end: tuple[float, ...]
    rows: tuple[Row, ...]
    largest: float
    marks: tuple[Mark, ...] = ()


@dataclass(frozen=True)
class Lane:
    """A lane of a gait diagram.

    Attributes:
        label: Name of the sensor.
        spans: Beginning and end of each contact, s.
    """

    label: str
    spans: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class GaitDiagram:
    """Ground contacts over time, one group of lanes per robot.

    Attributes:
        title: Title.
        groups: Lanes by the name of the robot.
        end: Duration of the trial, s.
    """

    KIND: ClassVar[str] = "gait"
    title: str
    groups: Mapping[str, tuple[Lane, ...]]
    end: float


Cell = float | int | str | bool | None
"""Cell of a table; None if it is empty."""


@dataclass(frozen=True)
class Table:
    """A table that the reader can sort.

    Attributes:
        title: Title.
        columns: Name of each column, with its unit.
        rows: Cells: numbers, texts, truth values, or None for an empty cell.
    """

    KIND: ClassVar[str] = "table"
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]


@dataclass(frozen=True)
class Picture:
    """A picture.

    Attributes:
        title: Title, which is also the text for screen readers.
        media_type: Media type, such as ``image/png``.
        data: The file in base64.
    """

    KIND: ClassVar[str] = "picture"
    title: str
    media_type: str
    data: str


@dataclass(frozen=True)
class Attachment:
    """A file that the reader can save.

    Attributes:
        title: What the file is.
        name: Name of the file.
        data: The file in base64.
    """

    KIND: ClassVar[str] = "file"
    title: str
    name: str
    data: str


Item = LineChart | BarChart | IntervalChart | HeatMap | GaitDiagram | Table | Picture | Attachment
"""What a section shows."""
