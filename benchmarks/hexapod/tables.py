"""Tables of the rows of ``benchmarks.hexapod``, in Markdown."""

from collections.abc import Sequence

from benchmarks.rows import lines_of, markdown, rate, spread
from selfmodel.studies.study import Row

HEADINGS = {"model": "self-model", "gain": "gain", "design": "gaits", "group": "failed"}
"""Column of each part of what names a line."""

LARGEST_TURN = 15.0
"""Change of heading up to which a trial counts as straight, degrees."""


def table(rows: Sequence[Row]) -> str:
    """Returns a table of each command that has rows, with Wilson's 95 % intervals."""
    parts, columns = [], {"walk": _walks, "diagnose": _diagnoses, "recover": _recoveries}
    for command in dict.fromkeys(row["command"] for row in rows):
        own = [row for row in rows if row["command"] == command]
        lines = lines_of(own, HEADINGS, columns[command])
        parts.append(markdown(lines, texts=len(HEADINGS)))
    return "\n".join(parts)


def _walks(rows: Sequence[Row]) -> dict[str, str]:
    return {
        "predicted, m": _values([row["predicted"] for row in rows]),
        "at a quarter of the step, m": _values([row["finer"] for row in rows]),
        "walked, m": _values([row["walked"] for row in rows]),
        "walked ÷ predicted": _values([row["walked"] / row["predicted"] for row in rows]),
        **_courses(rows),
        **_seconds(rows),
    }


def _diagnoses(rows: Sequence[Row]) -> dict[str, str]:
    return {
        "legs named": rate([row["right"] for row in rows]),
        "kinds": ", ".join(sorted({kind for row in rows for kind in row["kinds"]})),
        "seconds of the diagnosis": _values([row["spent"] for row in rows]),
        **_seconds(rows),
    }


def _recoveries(rows: Sequence[Row]) -> dict[str, str]:
    first = [row["trials"][0] for row in rows]
    best = [max(row["trials"], key=lambda trial: float(trial["walked"])) for row in rows]
    trials = [trial for row in rows for trial in row["trials"]]
    before = [row["before"] for row in rows]
    return {
        "legs named": rate([row["right"] for row in rows]),
        "before, m": _values(before),
        "after, m": _values([row["after"] for row in rows]),
        "first trial, m": _values([trial["walked"] for trial in first]),
        "first ÷ before": _ratios(first, before),
        "best ÷ before": _ratios(best, before),
        **_courses(trials),
        **_seconds(rows),
    }


def _ratios(trials: Sequence[Row], before: Sequence[float]) -> str:
    return _values([trial["walked"] / own for trial, own in zip(trials, before, strict=True)])


def _courses(trials: Sequence[Row]) -> dict[str, str]:
    turns = [abs(trial["heading"]) for trial in trials]
    straight = rate([turn <= LARGEST_TURN for turn in turns])
    upright = rate([not trial["fell"] for trial in trials])
    return {"turn, degrees": _values(turns), "straight": straight, "upright": upright}


def _values(values: Sequence[float]) -> str:
    """Returns the median and the range, or the one value."""
    return spread(values) if len(values) > 1 else f"{values[0]:.3g}"


def _seconds(rows: Sequence[Row]) -> dict[str, str]:
    return {"CPU seconds": _values([row["seconds"] for row in rows])}
