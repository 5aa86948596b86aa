"""Tables of the rows of ``benchmarks.go1``, in Markdown."""

from collections.abc import Mapping, Sequence
from statistics import median

from benchmarks.foreign.scoring import rate
from selfmodel.studies.study import Row
from selfmodel.studies.tables import markdown_of, table_of

GOALS: Mapping[str, tuple[str, float]] = {
    **{f"{how} thigh": ("first", 9.0) for how in ("dead", "locked")},
    "dead calf, rear": ("best", 7.0),
    "dead calf, front": ("best", 5.0),
    "dead leg, rear": ("best", 5.0),
    "dead leg, front": ("best", 3.0),
}
"""Trial of a recovery, and what is asked of it in 10 s, m, by the beginning of the group."""


def table(rows: Sequence[Row]) -> str:
    """Returns a table of each command that has rows, with Wilson's 95 % intervals."""
    parts = []
    for command in dict.fromkeys(row["command"] for row in rows):
        own = [row for row in rows if row["command"] == command]
        names, answers = (sorted({row[key] for row in own}) for key in ("group", "answer"))
        groups = {name: [row for row in own if row["group"] == name] for name in names}
        lines = [
            {"group": name, **(_scores(each) if command == "recover" else _rates(each, answers))}
            for name, each in {**groups, "all": own}.items()
        ]
        parts.append(markdown_of(table_of(command, lines, lines, texts=1)))
    return "\n".join(parts)


def _rates(rows: Sequence[Row], answers: Sequence[str]) -> dict[str, str]:
    given = [row["answer"] for row in rows]
    counts = {each: str(given.count(each)) for each in answers if each != "right"}
    first, right = [row["first"] for row in rows], [each == "right" for each in given]
    return {"right first": rate(first), "right": rate(right), **counts, **_seconds(rows)}


def _scores(rows: Sequence[Row]) -> dict[str, str]:
    trials = [[*zip(row["scores"], row["falls"], strict=True)] for row in rows]
    chosen = {"first": [each[0] for each in trials], "best": [max(each) for each in trials]}
    goals = {at for name, at in GOALS.items() if all(row["group"].startswith(name) for row in rows)}
    return {
        **{name: _values([row[name] for row in rows]) for name in ("before", "unadapted")},
        **{f"{of} trial": _values([score for score, _ in each]) for of, each in chosen.items()},
        **{f"{of} upright": rate([not fell for _, fell in each]) for of, each in chosen.items()},
        "goal": "".join(
            f"{of} ≥ {least:g} m: {rate([score >= least for score, _ in chosen[of]])}"
            for of, least in goals
        ),
        "diagnosis right": rate([row["answer"] == "right" for row in rows]),
        **_seconds(rows),
    }


def _values(values: Sequence[float]) -> str:
    return f"{median(values):.1f} ({min(values):.1f} to {max(values):.1f})"


def _seconds(rows: Sequence[Row]) -> dict[str, str]:
    seconds = [row["seconds"] for row in rows]
    return {"CPU seconds": f"{median(seconds):.0f} ({min(seconds)} to {max(seconds)})"}
