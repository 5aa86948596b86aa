"""A diagnosis as sentences."""

import math
import re
from collections.abc import Sequence

from selfmodel.diagnosis.diagnosis import DetectableSeverity, Diagnosis
from selfmodel.diagnosis.direct_evidence import DirectEvidence
from selfmodel.diagnosis.significance import LOSS_RATIO, NEGLIGIBLE_LOSS

SIGMA = "\u03c3"  # standard errors

_SEVERITY = re.compile(r"=([a-z]*)[^=]*$")  # the prefix belongs to the kind, the number does not


def verdict_sentences(diagnosis: Diagnosis) -> str:
    """Returns the verdict, the change and the undetectable faults as sentences."""
    change = str(diagnosis.change) if diagnosis.change else ""
    besides = ", ".join(map(str, diagnosis.undetectable_faults))
    return (
        _verdict(diagnosis)
        + (f" {change[0].upper()}{change[1:]}." if change else "")
        + (f" Undetectable in these trials: {besides}." if besides else "")
    )


def fit_sentence(diagnosis: Diagnosis) -> str:
    """Returns the numbers behind the verdict as a sentence; empty if there are none."""
    fit = diagnosis.fit
    if fit is None or not math.isfinite(fit.loss):
        return ""
    losses = f"mean loss {_number(fit.loss)}, intact {_number(fit.intact_loss)}"
    if fit.healthy_loss is None or fit.excess is None:
        return f"M{losses[1:]}; no trial of the healthy robot to compare with."
    limit = f"limit {fit.threshold:g} {SIGMA}, or {LOSS_RATIO:g} times their loss"
    return (
        f"Residual {_excess(fit.excess)} above the healthy trials ({limit}); {losses}, healthy "
        f"trials {_number(fit.healthy_loss)}."
    )


def detectable_sentences(diagnosis: Diagnosis) -> list[str]:
    """Returns the smallest detectable severity of each kind as a sentence, if it was computed."""
    rows = diagnosis.detectable
    if not rows:
        return []
    kinds = dict.fromkeys(row.kind for row in rows)
    limits = "; ".join(
        f"{kind} {_limits([row for row in rows if row.kind == kind])}" for kind in kinds
    )
    return [f"These trials would have shown: {limits}. Smaller changes are below the limit."]


def evidence_sentences(evidence: Sequence[DirectEvidence]) -> list[str]:
    """Returns the evidence that needs no simulation: joints that stand, and constant sensors."""
    sentences = []
    for one in evidence:
        constant = [f"{each.sensor} ({each.reading:g})" for each in one.constant_sensors]
        idle = ", ".join(one.commands_without_effect)
        facts = [f"commands without effect: {idle}"] if idle else []
        facts += [f"constant readings: {', '.join(constant)}"] if constant else []
        sentences += [f"In {one.trial}, {'; '.join(facts)}."] if facts else []
    return sentences


def right_or_wrong(best: str, truth: str, *, correct: bool) -> str:
    """Returns the judgement of the best hypothesis, given the true one.

    Args:
        best: Notation of the best hypothesis.
        truth: Notation of the true hypothesis.
        correct: Whether the best hypothesis counts as the true one.
    """
    if correct:
        return "right"
    return "right except for severity" if _faults(best) == _faults(truth) else "wrong"


def _faults(notation: str) -> set[str]:
    """Returns the terms of a notation without the numbers of severities, with their prefixes."""
    return {_SEVERITY.sub(r"=\1", term).rstrip("=") for term in notation.split("+")}


def _number(loss: float) -> str:
    if not math.isfinite(loss):
        return "infinite"
    return "0" if loss <= NEGLIGIBLE_LOSS else f"{loss:.3g}"


def _excess(excess: float) -> str:
    return f"{excess:.1f} {SIGMA}" if math.isfinite(excess) else f"infinitely many {SIGMA}"


def _limits(rows: Sequence[DetectableSeverity]) -> str:
    """Returns the detectable severities of one kind, equal ones of several parts together."""
    parts: dict[str, list[str]] = {}
    for row in rows:
        sides = (("up to", row.below), ("from", row.above))
        limits = " or ".join(f"{word} {value:.4g}" for word, value in sides if value is not None)
        parts.setdefault(limits or "no severity", []).append(row.part)
    return ", ".join(
        f"{limits} ({', '.join(names)})" if len(parts) > 1 else limits
        for limits, names in parts.items()
    )


def _verdict(diagnosis: Diagnosis) -> str:
    best = diagnosis.best
    match diagnosis.verdict:
        case "intact":
            return "Intact: the healthy robot predicts the trials, and no other hypothesis does so."
        case "explained":
            alone = "" if diagnosis.undetectable else ", and no other hypothesis does as well"
            return f"Explained: {best} predicts the trials{alone}."
        case "ambiguous":
            others = ", ".join(map(str, diagnosis.indistinguishable))
            return (
                f"Ambiguous: the trials do not distinguish {best} from {others} ({diagnosis.test})."
            )
    return _unexplained(diagnosis)


def _unexplained(diagnosis: Diagnosis) -> str:
    best, unsearched, fit = diagnosis.best, diagnosis.unsearched, diagnosis.fit
    if diagnosis.reason:
        return f"Unexplained: {diagnosis.reason}."
    if unsearched is not None:
        also = f" ({', '.join(unsearched.others)} would do so too)" if unsearched.others else ""
        return (
            f"Unexplained: {unsearched.hypothesis} predicts the trials significantly better than "
            f"{best}{also}; add {unsearched.kind} to --kinds."
        )
    listed = ", ".join(
        f"{name} ({_excess(excess)})" for name, excess in (fit.joints if fit else {}).items()
    )
    joints = f" Joints that the healthy trials predict better: {listed}." if listed else ""
    if fit is not None and joints and not fit.is_too_high:
        return (
            f"Unexplained: {best} predicts the trials as a whole, and not all joints.{joints} "
            f"There is a fault of a kind that was not searched (--kinds), or a combination of "
            f"faults."
        )
    return (
        f"Unexplained: even {best} predicts the trials significantly worse than the self-model "
        f"predicts the healthy robot; there is another fault, or one of a kind that was not "
        f"searched (--kinds).{_residual(diagnosis)}{joints}"
    )


def _residual(diagnosis: Diagnosis) -> str:
    """Returns the share, the signals and the time of the loss that is left, as a sentence."""
    left, share = diagnosis.residual, diagnosis.fit.left if diagnosis.fit else None
    if left is None:
        return ""
    amount = "Most" if share is None else f"{share:.0%} of the loss"
    return (
        f" {amount} is left: in {', '.join(left.signals)}, most of it at t = {left.begin:.1f} to "
        f"{left.end:.1f} s of {left.trial}."
    )
