"""A diagnosis as plain values and as a table."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rich.table import Table

from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis
from selfmodel.faults.hypothesis import Hypothesis


def as_values(ranked: Sequence[Candidate]) -> list[dict[str, Any]]:
    """Returns hypotheses with their distances, as JSON has them: null where one diverged."""
    return [
        {
            "hypothesis": str(candidate.hypothesis),
            "distance": candidate.distance if math.isfinite(candidate.distance) else None,
        }
        for candidate in ranked
    ]


def sureness(diagnosis: Diagnosis) -> dict[str, Any]:
    """Returns how sure a diagnosis is, as JSON has it."""
    intact = diagnosis.intact_distance
    return {
        "verdict": diagnosis.verdict,
        "rivals": [str(rival) for rival in diagnosis.indistinguishable],
        "unseen": [_besides(one, diagnosis.best) for one in diagnosis.undetectable],
        "test": diagnosis.test,
        "outside": diagnosis.unsearched.as_object() if diagnosis.unsearched else None,
        "intact_distance": intact if math.isfinite(intact) else None,
    }


def _besides(one: Hypothesis, best: Hypothesis) -> str:
    return str(Hypothesis(tuple(fault for fault in one.faults if fault not in best.faults)))


def in_words(found: Mapping[str, Any]) -> str:
    """Returns how sure a diagnosis is, as a sentence or two.

    Args:
        found: What ``sureness`` says, and under ``diagnosis`` what ``as_values`` does.
    """
    besides = ", ".join(found["unseen"])
    return _verdict(found) + (f" Not ruled out besides: {besides}." if besides else "")


def _verdict(found: Mapping[str, Any]) -> str:
    best = found["diagnosis"][0]["hypothesis"]
    match found["verdict"]:
        case "explained":
            alone = "" if found["unseen"] else ", and nothing else as well"
            return f"Explained: {best} predicts the trials{alone}."
        case "ambiguous":
            others = ", ".join(found["rivals"])
            return f"Ambiguous: the trials cannot tell {best} from {others} ({found['test']})."
    if found["outside"] is not None:
        better, kind = found["outside"]["hypothesis"], found["outside"]["kind"]
        return (
            f"Unexplained: {better} predicts the trials significantly better than {best}; add "
            f"{kind} to --kinds."
        )
    return (
        f"Unexplained: even {best} predicts the trials significantly worse than the self-model "
        f"predicts the intact robot; something else is wrong, or what is wrong is of a kind that "
        f"was not considered (--kinds)."
    )


def ranking_table(values: Sequence[dict[str, Any]], truth: str | None = None) -> Table:
    """Returns hypotheses as a table, best first, the truth marked where it is known."""
    table = Table("", "hypothesis", "distance", title="diagnosis")
    table.columns[1].overflow = "fold"
    table.columns[2].justify = "right"
    for rank, one in enumerate(values, start=1):
        mark = " (the truth)" if one["hypothesis"] == truth else ""
        distance = one["distance"]
        table.add_row(
            str(rank),
            one["hypothesis"] + mark,
            "diverged" if distance is None else f"{distance:.4f}",
        )
    return table
