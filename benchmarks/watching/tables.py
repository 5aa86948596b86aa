"""Tables of the rows of ``benchmarks.watching``, in Markdown."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from benchmarks.rows import lines_of, markdown, rate
from benchmarks.watching.streams import FAULTS
from selfmodel.studies.study import Row

HEADINGS = {"robot": "robot", "gap": "gap", "gaits": "gaits", "case": "fault"}
"""Column of each part of what names a line."""


def table(rows: Sequence[Row]) -> str:
    """Returns a table of the healthy robots, of the faults, of recordings and of other methods."""
    parts = []
    for command, columns, names in (
        ("healthy", _healthy, ("robot", "gap", "gaits")),
        ("faults", _faults, ("robot", "case")),
    ):
        own = sorted(
            (row for row in rows if row["command"] == command),
            key=lambda row: [str(row[name]) for name in names],
        )
        lines = lines_of(own, {name: HEADINGS[name] for name in names}, columns)
        parts.append(markdown(lines, texts=len(names)))
    recordings = [
        {
            "recording": row["recording"],
            "truth": row["truth"],
            "healthy trials": row["healthy"],
            "length, s": f"{row['length']:.1f}",
            "findings": "; ".join(row["findings"]),
        }
        for row in rows
        if row["command"] == "recordings"
    ]
    parts.append(markdown(recordings, texts=3))
    if rivals := [row for row in rows if row["command"] == "rivals"]:
        parts.append(
            _compared(rivals, [row for row in rows if row["command"] in ("healthy", "faults")])
        )
    return "\n".join(filter(None, parts))


def _healthy(rows: Sequence[Row]) -> dict[str, str]:
    hours = sum(row["judged"] for row in rows) / 3600
    alarms = sum(len(row["alarms"]) for row in rows)
    # Of a Poisson process: Garwood 1936, Biometrika 28.
    low = chi2.ppf(0.025, 2 * alarms) / 2 / hours if alarms else 0.0
    high = chi2.ppf(0.975, 2 * alarms + 2) / 2 / hours
    total = sum(60 * row["minutes"] for row in rows)
    return {
        "robots": str(len(rows)),
        "hours": f"{total / 3600:.2f}",
        "judged": f"{100 * 3600 * hours / total:.0f} %",
        "alarms": str(alarms),
        "an hour judged": f"{alarms / hours:.2f} ({low:.2f} to {high:.2f})",
        "real-time factor": f"{sum(row['seconds'] for row in rows) / total:.3f}",
    }


def _faults(rows: Sequence[Row]) -> dict[str, str]:
    early = [row for row in rows if row["alarm"] is not None and row["alarm"] < row["onset"]]
    timely = [row for row in rows if row not in early]
    seen = [row for row in timely if row["alarm"] is not None]
    delays = [row["alarm"] - row["onset"] for row in seen]
    # A fault that is not seen counts as one after all others.
    late = sorted([*delays, *[np.inf] * (len(timely) - len(seen))])
    errors = [abs(row["dated"][0] - row["onset"]) for row in seen]
    inside = [row["dated"][1] <= row["onset"] <= row["dated"][2] for row in seen]
    ends = [row["ended"] - row["alarm"] for row in seen if row["status"] != "changed"]
    return {
        "robots": str(len(rows)),
        "alarm before the onset": str(len(early)),
        "alarm": rate([row["alarm"] is not None for row in timely]),
        "delay, s (median; longest)": f"{_middle(late):.2f}; {late[-1]:.2f}" if late else "",
        "cause right": rate([row["right"] and row["status"] == "explained" for row in timely]),
        "of those explained": rate([row["right"] for row in seen if row["status"] == "explained"]),
        "from alarm to cause, s": _range(ends),
        "error of the onset, s": _range(errors),
        "onset in its interval": rate(inside),
    }


def _middle(ordered: Sequence[float]) -> float:
    return ordered[(len(ordered) - 1) // 2]


def _range(values: Sequence[float]) -> str:
    return f"{_middle(sorted(values)):.2f} (to {max(values):.2f})" if values else ""


THRESHOLDS = {"healthy": "1.25 of healthy", "oracle": "oracle"}
"""Thresholds of the other methods, and how the table says them."""


def _compared(rows: Sequence[Row], watches: Sequence[Row]) -> str:
    """Returns a table of other methods, and of the watches of the same robots and faults."""
    machines = {_machine(row) for row in rows}
    lines = list[dict[str, str]]()
    for name in dict.fromkeys(row["method"] for row in rows):
        for threshold, words in THRESHOLDS.items():
            found = [(row, row["thresholds"][threshold]) for row in rows if row["method"] == name]
            faults = [(case, one[case]) for _, one in found for case in FAULTS]
            alarms = sum(one["alarms"] for _, one in found)
            minutes = sum(row["minutes"] for row, _ in found)
            lines.append(_rival(name, words, alarms, minutes, faults))
    watched = [row for row in watches if _machine(row) in machines]
    healthy = [row for row in watched if row["command"] == "healthy" and row["gaits"] == "known"]
    faults = [
        (row["case"], _as_rival(row))
        for row in watched
        if row["command"] == "faults" and row["draw"] == 0
    ]
    alarms = sum(len(row["alarms"]) for row in healthy)
    minutes = sum(row["judged"] for row in healthy) / 60
    lines.insert(0, _rival("`watch`", "its own", alarms, minutes, faults))
    return markdown(lines, texts=2)


def _machine(row: Row) -> tuple[str, str, int]:
    return row["robot"], row["gap"], row["seed"]


def _as_rival(row: Row) -> Row:
    """Returns the row of a fault of a watch as that of another method."""
    is_early = row["alarm"] is not None and row["alarm"] < row["onset"]
    seen = row["alarm"] is not None and not is_early
    delay = row["alarm"] - row["onset"] if seen else None
    return {"onset": row["onset"], "early": is_early, "delay": delay, "right": row["right"]}


def _rival(
    name: str, threshold: str, alarms: int, minutes: float, faults: Sequence[tuple[str, Row]]
) -> dict[str, str]:
    early = sum(fault["early"] for _, fault in faults)
    hours = minutes / 60 + sum(fault["onset"] for _, fault in faults) / 3600
    seen = [fault for _, fault in faults if fault["delay"] is not None]

    def delay(chosen: Sequence[Row]) -> str:
        late = sorted(np.inf if one["delay"] is None else one["delay"] for one in chosen)
        middle = _middle(late)
        return f"{middle:.2f}" if np.isfinite(middle) else "—"

    of_case = {case: [fault for name, fault in faults if name == case] for case in FAULTS}
    return {
        "method": name,
        "threshold": threshold,
        "false alarms an hour": f"{(alarms + early) / hours:.1f}",
        "delay, s": delay([fault for _, fault in faults]),
        **{case: delay(chosen) for case, chosen in of_case.items()},
        "within 1 s": rate(
            [fault["delay"] is not None and fault["delay"] <= 1.0 for _, fault in faults]
        ),
        "missed": str(len(faults) - len(seen)),
        "part right": rate([fault["right"] for fault in seen]),
    }
