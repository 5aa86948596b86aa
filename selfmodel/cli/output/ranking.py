"""A diagnosis as sentences and as a table, from its JSON values."""

from collections.abc import Mapping, Sequence
from typing import Any

from rich.table import Table

from selfmodel.cli.output.plain import plain


def confidence_sentence(found: Mapping[str, Any]) -> str:
    """Returns the verdict and the alternatives to the best hypothesis, in one or two sentences.

    Args:
        found: Values of ``confidence_to_dict``, and under ``diagnosis`` those of
            ``ranking_to_list``.
    """
    besides = ", ".join(found["unseen"])
    return _verdict(found) + (f" Undetectable in these trials: {besides}." if besides else "")


def detectable_sentences(found: Mapping[str, Any]) -> list[str]:
    """Returns the smallest detectable weakness of the motors as a sentence, if it was measured.

    Args:
        found: Result of ``confidence_to_dict``.
    """
    weaknesses = found.get("detectable", ())
    if not weaknesses:
        return []
    limits = ", ".join(
        f"{one['joint']} " + ("none" if one["torque"] is None else f"{one['torque']:g}")
        for one in weaknesses
    )
    sentence = (
        f"A weak motor would have shown at this fraction of its torque or less; a smaller "
        f"weakness is below what these trials show: {limits}."
    )
    return [sentence]


def _verdict(found: Mapping[str, Any]) -> str:
    best = found["diagnosis"][0]["hypothesis"]
    match found["verdict"]:
        case "explained":
            alone = "" if found["unseen"] else ", and no other hypothesis does as well"
            return f"Explained: {best} predicts the trials{alone}."
        case "ambiguous":
            others = ", ".join(found["rivals"])
            return (
                f"Ambiguous: the trials do not distinguish {best} from {others} ({found['test']})."
            )
    if found["reason"] is not None:
        return f"Unexplained: {found['reason']}."
    if found["outside"] is not None:
        better, kind = found["outside"]["hypothesis"], found["outside"]["kind"]
        return (
            f"Unexplained: {better} predicts the trials significantly better than {best}; add "
            f"{kind} to --kinds."
        )
    return (
        f"Unexplained: even {best} predicts the trials significantly worse than the self-model "
        f"predicts the healthy robot; there is another fault, or one of a kind that was not "
        f"searched (--kinds)."
    )


def ranking_table(values: Sequence[dict[str, Any]], truth: str | None = None) -> Table:
    """Returns hypotheses as a table, best first; the truth is marked where it is given."""
    table = Table("", "hypothesis", "distance", title="diagnosis")
    table.columns[1].overflow = "fold"
    table.columns[2].justify = "right"
    for rank, one in enumerate(values, start=1):
        mark = " (the truth)" if one["hypothesis"] == truth else ""
        distance = one["distance"]
        table.add_row(
            str(rank),
            plain(one["hypothesis"]) + mark,
            "diverged" if distance is None else f"{distance:.4f}",
        )
    return table
