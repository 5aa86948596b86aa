"""Judged answers as a CSV file, one row per recording."""

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from benchmarks.foreign.scoring.judge import judged

COLUMNS = (
    *("recording", "group", "kinds", "trials", "truth", "onset", "best", "verdict", "rivals"),
    *("outside", "change", "loss", "healthy_loss", "right", "verdict_right", "seconds"),
)


def write_csv(rows: Iterable[dict[str, Any]], path: Path) -> None:
    """Writes one row per answer, sorted by recording.

    Args:
        rows: Rows of the scores.
        path: File to write.
    """
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(sorted(map(_values, rows), key=lambda row: str(row["recording"])))


def _values(row: dict[str, Any]) -> dict[str, Any]:
    truth, answer, found = row["truth"], row["answer"] or {}, judged(row)
    fit = answer.get("fit") or {}
    return {
        "recording": row["name"],
        "group": truth["group"],
        "kinds": row["asked"]["kinds"] or "default",
        "trials": row["asked"]["trials"],
        "truth": "+".join(truth["truth"]) or "intact",
        "onset": truth["onset"],
        "best": answer["diagnosis"][0]["hypothesis"] if answer else row["error"][-200:],
        "verdict": answer.get("verdict", "error"),
        "rivals": len(answer.get("indistinguishable", ())),
        "outside": (answer.get("unsearched") or {}).get("hypothesis"),
        "change": (answer.get("change") or {}).get("time"),
        "loss": _rounded(fit.get("loss")),
        "healthy_loss": _rounded(fit.get("healthy_loss")),
        "right": found.right,
        "verdict_right": found.verdict_right,
        "seconds": round(row.get("seconds", 0.0), 1),
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.3g}")
