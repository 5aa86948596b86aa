"""A diagnosis as sentences, from its JSON values."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from selfmodel.diagnosis.verdicts.fit import FAULTY_RATIO
from selfmodel.diagnosis.verdicts.significance import LOSS_FLOOR, LOSS_RATIO

_SEVERITY = re.compile(r"=([a-z]*)[^=]*$")  # the prefix belongs to the kind, the number does not


def confidence_sentence(found: Mapping[str, Any]) -> str:
    """Returns the verdict and the alternatives to the best hypothesis, in one or two sentences.

    Args:
        found: Values of ``confidence_to_dict``, and under ``diagnosis`` those of
            ``ranking_to_list``.
    """
    besides = ", ".join(found["unseen"])
    change = found.get("change")
    return (
        _verdict(found)
        + (f" {_change(change)}" if change else "")
        + (f" Undetectable in these trials: {besides}." if besides else "")
    )


def fit_sentence(found: Mapping[str, Any]) -> str:
    """Returns the numbers behind the verdict as a sentence; empty if there are none.

    Args:
        found: Result of ``confidence_to_dict``.
    """
    fit = found.get("fit")
    if not fit or fit["loss"] is None:
        return ""
    loss = f"Mean loss {fit['loss']:.3g}, of intact {_number(fit['intact_loss'])}"
    if fit["healthy_loss"] is None and fit["excess"] is None:
        return f"{loss}; no trial of the healthy robot to compare with."
    excess = "infinitely many" if fit["excess"] is None else f"{fit['excess']:.3g}"
    ratio = f" and {FAULTY_RATIO:g} times that loss" if fit["has_faults"] else ""
    return (
        f"{loss}, on healthy trials {_number(fit['healthy_loss'])}: an excess of {excess} standard "
        f"errors, unexplained above {fit['threshold']:g}{ratio}, or above {LOSS_RATIO:g} times "
        f"that loss."
    )


def evidence_sentences(found: Mapping[str, Any]) -> list[str]:
    """Returns the evidence that needs no simulation: joints that stand, and constant sensors.

    Args:
        found: Values of ``--json`` output.
    """
    sentences = []
    for one in found["evidence"]:
        idle = one["commands_without_effect"]
        constant = [f"{each['sensor']} ({each['reading']:g})" for each in one["constant_sensors"]]
        facts = [f"commands without effect: {', '.join(idle)}"] if idle else []
        facts += [f"constant readings: {', '.join(constant)}"] if constant else []
        sentences += [f"In {one['trial']}, {'; '.join(facts)}."] if facts else []
    return sentences


def right_or_wrong(found: Mapping[str, Any]) -> str:
    """Returns the judgement of the best hypothesis, given the true one.

    Args:
        found: Values of ``--json`` output of a recovery.
    """
    if found["correct"]:
        return "right"
    best, truth = found["diagnosis"][0]["hypothesis"], found["truth"]
    return "right except for severity" if _faults(best) == _faults(truth) else "wrong"


def _faults(notation: str) -> set[str]:
    """Returns the terms of a notation without the numbers of severities, with their prefixes."""
    return {_SEVERITY.sub(r"=\1", term).rstrip("=") for term in notation.split("+")}


def _number(value: float | None) -> str:
    return "infinite" if value is None else f"{value:.3g}"


def _change(change: Mapping[str, Any]) -> str:
    return (
        f"Changed at about t = {change['time']:.1f} s ({change['earliest']:.1f} to "
        f"{change['latest']:.1f}) of {change['trial']}; before: {change['before']}."
    )


def detectable_sentences(found: Mapping[str, Any]) -> list[str]:
    """Returns the smallest detectable severity of each kind as a sentence, if it was computed.

    Args:
        found: Result of ``confidence_to_dict``.
    """
    rows = found.get("detectable", ())
    if not rows:
        return []
    kinds = dict.fromkeys(row["kind"] for row in rows)
    limits = "; ".join(
        f"{kind} {_limits([row for row in rows if row['kind'] == kind])}" for kind in kinds
    )
    return [f"These trials would have shown: {limits}. Smaller changes are below the limit."]


def _limits(rows: Sequence[Mapping[str, Any]]) -> str:
    """Returns the detectable severities of one kind, equal ones of several parts together."""
    parts: dict[str, list[str]] = {}
    for row in rows:
        sides = (("up to", row["below"]), ("from", row["above"]))
        limits = " or ".join(f"{word} {value:.4g}" for word, value in sides if value is not None)
        parts.setdefault(limits or "no severity", []).append(row["part"])
    return ", ".join(
        f"{limits} ({', '.join(names)})" if len(parts) > 1 else limits
        for limits, names in parts.items()
    )


def _verdict(found: Mapping[str, Any]) -> str:
    best = found["diagnosis"][0]["hypothesis"]
    match found["verdict"]:
        case "intact":
            return "Intact: the healthy robot predicts the trials, and no other hypothesis does so."
        case "explained":
            alone = "" if found["unseen"] else ", and no other hypothesis does as well"
            return f"Explained: {best} predicts the trials{alone}."
        case "ambiguous":
            others = ", ".join(found["rivals"])
            return (
                f"Ambiguous: the trials do not distinguish {best} from {others} ({found['test']})."
            )
    return _unexplained(found)


def _unexplained(found: Mapping[str, Any]) -> str:
    best = found["diagnosis"][0]["hypothesis"]
    if found["reason"] is not None:
        return f"Unexplained: {found['reason']}."
    if found["outside"] is not None:
        better, kind = found["outside"]["hypothesis"], found["outside"]["kind"]
        others = found["outside"].get("others", {})
        also = f" ({', '.join(others)} would do so too)" if others else ""
        return (
            f"Unexplained: {better} predicts the trials significantly better than {best}{also}; "
            f"add {kind} to --kinds."
        )
    joints = _joints(found)
    if joints and not _exceeds(found["fit"]):
        return (
            f"Unexplained: {best} predicts the trials as a whole, and not all joints.{joints} "
            f"There is a fault of a kind that was not searched (--kinds), or a combination of "
            f"faults."
        )
    return (
        f"Unexplained: even {best} predicts the trials significantly worse than the self-model "
        f"predicts the healthy robot; there is another fault, or one of a kind that was not "
        f"searched (--kinds).{_residual(found)}{joints}"
    )


def _residual(found: Mapping[str, Any]) -> str:
    """Returns the share, the signals and the time of the loss that is left, as a sentence."""
    left = found.get("residual")
    if not left:
        return ""
    share = (found.get("fit") or {}).get("left")
    amount = "Most" if share is None else f"{share:.0%} of the loss"
    return (
        f" {amount} is left: in {', '.join(left['signals'])}, most of it at t = "
        f"{left['begin']:.1f} to {left['end']:.1f} s of {left['trial']}."
    )


def _exceeds(fit: Mapping[str, Any]) -> bool:
    """Returns whether the loss is unexplained without the excess of joints."""
    if fit["loss"] is None or fit["healthy_loss"] is None or fit["excess"] is None:
        return True
    is_large = fit["loss"] > LOSS_RATIO * fit["healthy_loss"] + LOSS_FLOOR
    return bool(is_large or fit["excess"] > fit["threshold"])


def _joints(found: Mapping[str, Any]) -> str:
    """Returns the joints that move otherwise than in healthy trials, as a sentence."""
    joints = (found.get("fit") or {}).get("joints")
    if not joints:
        return ""
    listed = ", ".join(
        name if excess is None else f"{name} ({excess:.1f})" for name, excess in joints.items()
    )
    return (
        f" Joints whose motion is predicted worse than in the healthy trials, by standard errors: "
        f"{listed}."
    )
