"""Tables of the rows of ``benchmarks.go1``, in Markdown."""

from collections.abc import Mapping, Sequence
from functools import partial

from benchmarks.rows import lines_of, markdown, rate, spread
from selfmodel.studies.study import Row

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
        named = sorted(({**row, "of": row["group"]} for row in own), key=lambda row: str(row["of"]))
        every = [*named, *({**row, "of": "all"} for row in own)]
        answers = sorted({row["answer"] for row in own})
        columns = _scores if command == "recover" else partial(_rates, answers=answers)
        parts.append(markdown(lines_of(every, {"of": "group"}, columns), texts=1))
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
        **{name: spread([row[name] for row in rows], ".1f") for name in ("before", "unadapted")},
        **{f"{of} trial": spread([s for s, _ in each], ".1f") for of, each in chosen.items()},
        **{f"{of} upright": rate([not fell for _, fell in each]) for of, each in chosen.items()},
        "goal": "".join(
            f"{of} ≥ {least:g} m: {rate([score >= least for score, _ in chosen[of]])}"
            for of, least in goals
        ),
        "diagnosis right": rate([row["answer"] == "right" for row in rows]),
        **_seconds(rows),
    }


def _seconds(rows: Sequence[Row]) -> dict[str, str]:
    return {"CPU seconds": spread([row["seconds"] for row in rows], ".0f")}
