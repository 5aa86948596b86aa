"""The content of a report: sections of charts and tables, and the robots on one timeline.

Every record is plain data. ``as_json`` returns the JSON that the page reads; numbers are those of
the logs and results, and NaN or infinite numbers are null.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from selfmodel.report.charts import Item

FORMAT = "selfmodel-report-1"
"""Format of the JSON in the page."""


@dataclass(frozen=True)
class Section:
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


@dataclass(frozen=True)
class Report:
    """A report.

    Attributes:
        title: Title of the page.
        headline: What happened, in one sentence.
        verdict: Further sentences about the result.
        sections: The sections, in order.
        scene: Robots on one timeline, as ``Scene.to_dict`` returns it; None without one.
        made_with: Versions by the name of the software.
    """

    title: str
    headline: str
    verdict: tuple[str, ...]
    sections: tuple[Section, ...]
    scene: Mapping[str, Any] | None = None
    made_with: Mapping[str, str] = dataclasses.field(default_factory=dict)


def as_json(report: Report) -> dict[str, Any]:
    """Returns the JSON values of a report; a number that is not finite is None."""
    return {"format": FORMAT, **_fields(report)}


def _fields(record: Any) -> dict[str, Any]:  # noqa: ANN401  # a record of this module
    kind = {"kind": record.KIND} if hasattr(record, "KIND") else {}
    names = (field.name for field in dataclasses.fields(record))
    return kind | {name: _value(getattr(record, name)) for name in names}


def _value(value: Any) -> Any:  # noqa: ANN401  # JSON
    if dataclasses.is_dataclass(value):
        return _fields(value)
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _value(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_value(item) for item in value]
    return value
