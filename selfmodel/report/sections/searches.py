"""Section of the searches: the best fitness of each EA by generation."""

from collections.abc import Sequence

from selfmodel.report.charts import LineChart, Series
from selfmodel.report.document import Section
from selfmodel.report.subject import Search


def searches_section(searches: Sequence[Search]) -> Section | None:
    """Returns the section of the searches; None if their progress was not recorded.

    Args:
        searches: Progress of the searches, in their order.
    """
    charts = tuple(
        _chart(title, y_label, [one for one in searches if one.kind == kind])
        for kind, title, y_label in (
            ("repair", "Repair: best score by generation", "best score"),
            ("diagnostic", "Diagnosis: best fitness by generation", "best fitness, minus distance"),
        )
        if any(one.kind == kind and one.best for one in searches)
    )
    if not charts:
        return None
    text = "Each line is one search: a repair before a trial, or the diagnosis after it."
    return Section("searches", "Progress of the searches", (text,), charts)


def _chart(title: str, y_label: str, searches: Sequence[Search]) -> LineChart:
    return LineChart(
        title=title,
        x_label="generation",
        y_label=y_label,
        series=tuple(
            Series(
                name=f"{number}. {one.hypothesis or 'diagnosis'}",
                x=tuple(map(float, range(1, len(one.best) + 1))),
                y=one.best,
            )
            for number, one in enumerate(searches, start=1)
        ),
    )
