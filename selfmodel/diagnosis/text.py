"""A diagnosis as sentences."""

import math
import re
from collections.abc import Sequence

from selfmodel.diagnosis.diagnosis import DetectableSeverity, Diagnosis, Doubt, Fit
from selfmodel.diagnosis.direct_evidence import DirectEvidence
from selfmodel.diagnosis.significance import LOSS_RATIO, NEGLIGIBLE_LOSS
from selfmodel.diagnosis.verdict import is_too_high
from selfmodel.faults.hypothesis import INTACT, Hypothesis

MAX_NAMED = 3
"""Causes that a summary names."""

NO_DOUBT = Doubt("the diagnosis does not say why", "record a trial of the healthy robot like these")

SIGMA = "\u03c3"  # standard errors

_SEVERITY = re.compile(r"=([a-z]*)[^=]*$")  # the prefix belongs to the kind, the number does not


def summary(diagnosis: Diagnosis) -> str:
    """Returns what is wrong, since when, how sure that is, and what to do, in plain words."""
    what, change = what_is_wrong(diagnosis), diagnosis.change
    if change is not None:
        before = f"; before that, {in_words(change.before)}" if change.before else ""
        what = f"from {change.time:.1f} s of the trial '{change.trial}' on, {what}{before}"
    sure = ""
    if diagnosis.verdict in ("intact", "explained"):
        sure = _probability(diagnosis, diagnosis.best, " sure")
    elif diagnosis.verdict == "unexplained" and diagnosis.probability:
        sure = f" ({_percent(1 - sum(diagnosis.probability.values()))} sure)"
    return f"{what[0].upper()}{what[1:]}{sure}. {_advice(diagnosis)}"


def what_is_wrong(diagnosis: Diagnosis) -> str:
    """Returns what is wrong with the robot, as a clause in plain words."""
    match diagnosis.verdict:
        case "intact":
            return "no fault was found that is large enough to show in these trials"
        case "explained":
            return in_words(diagnosis.best)
        case "ambiguous":
            return _alternatives(diagnosis)
        case "unexplained":
            if diagnosis.reason:
                return "these trials cannot be simulated"
            return "the robot differs from its model, and none of the faults tried explains it"
        case "not judged":
            return "these trials do not show whether the robot has a fault"


def in_words(hypothesis: Hypothesis) -> str:
    """Returns the faults of a hypothesis as clauses in plain words."""
    return ", and ".join(fault.words for fault in hypothesis.faults) or "nothing is wrong"


def _alternatives(diagnosis: Diagnosis) -> str:
    """Returns the faults that all alternatives have, then those in which they differ."""
    probability = diagnosis.probability
    alike = sorted(
        [diagnosis.best, *diagnosis.indistinguishable],
        key=lambda one: -probability.get(str(one), 0.0),
    )
    clauses = [[fault.words for fault in one.faults] for one in alike]
    shared = [one for one in alike[0].faults if all(one.words in each for each in clauses)]
    common = Hypothesis(tuple(shared))
    causes, known = [], [fault.words for fault in shared]
    for one, each in zip(alike[:MAX_NAMED], clauses, strict=False):
        own = ", and ".join(words for words in each if words not in known)
        nothing = "nothing else" if shared else in_words(INTACT)
        causes.append(f"{own or nothing}{_probability(diagnosis, one)}")
    if probability:
        rest = 1 - sum(probability.get(str(one), 0.0) for one in alike[:MAX_NAMED])
        causes.append(f"something not named here ({_percent(rest)})")
    elif len(alike) > MAX_NAMED:
        causes.append(f"one of {len(alike) - MAX_NAMED} others")
    listed = f"one of these is true: {', or '.join(causes)}"
    having = [p for one, p in probability.items() if _faults(str(common)) <= _faults(one)]
    sure = f" ({_percent(sum(having))} sure)" if having else ""
    return f"{in_words(common)}{sure}. In addition, {listed}" if shared else listed


def _percent(probability: float) -> str:
    return "< 1 %" if probability < 0.01 else f"{100 * probability:.0f} %"


def _probability(diagnosis: Diagnosis, hypothesis: Hypothesis, sure: str = "") -> str:
    """Returns the probability of a hypothesis in brackets, before a word; empty without one."""
    probability = diagnosis.probability.get(str(hypothesis))
    return "" if probability is None else f" ({_percent(probability)}{sure})"


def _advice(diagnosis: Diagnosis) -> str:
    """Returns what to do, and what would make the diagnosis surer, as sentences."""
    fit = diagnosis.fit
    surer = "record a longer trial, or one with other movements (such as another gait)"
    if fit is None or fit.healthy_loss is None:
        surer = "give a trial of the healthy robot to compare with (--healthy)"
    match diagnosis.verdict:
        case "intact":
            return f"To find smaller faults, {surer}."
        case "explained":
            return f"Check this; to be surer, {surer}."
        case "ambiguous":
            order = " in this order" if diagnosis.probability else ""
            return f"Check these{order}; to tell the causes apart, {surer}."
        case "unexplained":
            return _advice_on_the_unexplained(diagnosis, list(fit.joints) if fit else [])
        case "not judged":
            return (
                f"It may have one, or its model may be wrong for motions like these. To decide, "
                f"{(diagnosis.doubt or NO_DOUBT).remedy}; then repeat the diagnosis."
            )


def _advice_on_the_unexplained(diagnosis: Diagnosis, joints: Sequence[str]) -> str:
    unsearched, best = diagnosis.unsearched, diagnosis.best
    if diagnosis.reason:
        return "Check the model of the robot and the logs."
    if unsearched is not None:
        return (
            f"A kind of fault that was not tried fits better: {in_words(unsearched.hypothesis)}. "
            f"Check this, and repeat the diagnosis with --kinds default,{unsearched.kind} (if "
            f"other kinds than the default were tried, with these in place of default)."
        )
    repeat = "repeat the diagnosis with all kinds of faults (--kinds all)."
    if joints:
        return f"The difference is largest at the joint {joints[0]}: inspect it, then {repeat}"
    if best:
        words = f"{in_words(best)}{_probability(diagnosis, best)}"
        return (
            f"If it is one of them after all, then most probably this: {words}. Check it; if it is "
            f"not so, {repeat}"
        )
    return f"{repeat[0].upper()}{repeat[1:]}"


def verdict_sentences(diagnosis: Diagnosis) -> str:
    """Returns the verdict, the change, further kinds and undetectable faults as sentences."""
    sentences = [_verdict(diagnosis)]
    if diagnosis.change is not None:
        change = str(diagnosis.change)
        sentences.append(f"{change[0].upper()}{change[1:]}.")
    if diagnosis.also_searched:
        also = ", ".join(diagnosis.also_searched)
        sentences.append(
            f"Searched beyond the kinds asked for, to predict the trials better: {also}."
        )
    if diagnosis.undetectable:
        faults = ", ".join(map(str, diagnosis.undetectable_faults))
        sentences.append(f"Undetectable in these trials: {faults}.")
    return " ".join(sentences)


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
    rows: dict[str, list[DetectableSeverity]] = {}
    for row in diagnosis.detectable:
        rows.setdefault(row.kind, []).append(row)
    limits = "; ".join(f"{kind} {_limits(each)}" for kind, each in rows.items())
    sentence = f"These trials would have shown: {limits}. Smaller changes are below the limit."
    return [sentence] if limits else []


def evidence_sentences(evidence: Sequence[DirectEvidence]) -> list[str]:
    """Returns the evidence that needs no simulation: joints that stand, and constant sensors."""
    sentences = []
    for one in evidence:
        constant = [f"{each.sensor} ({each.reading:g})" for each in one.constant_sensors]
        idle = one.commands_without_effect
        facts = [f"commands without effect: {', '.join(idle)}"] if idle else []
        facts += [f"constant readings: {', '.join(constant)}"] if constant else []
        sentences += [f"In {one.trial}, {'; '.join(facts)}."] if facts else []
    return sentences


def right_or_wrong(best: str, truth: str, *, correct: bool) -> str:
    """Returns the judgement of the notation of the best hypothesis, given that of the true one."""
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
        case "unexplained":
            return f"Unexplained: {_missing(diagnosis)}"
        case "not judged":
            return f"Not judged: {_doubt(diagnosis)}"


def _doubt(diagnosis: Diagnosis) -> str:
    """Returns why trials are not judged, as a sentence."""
    reason = (diagnosis.doubt or NO_DOUBT).reason
    return f"{reason}, so that a fault and an error of the self-model cannot be told apart."


def _missing(diagnosis: Diagnosis) -> str:
    """Returns what is known of the fault that is missing in an unexplained diagnosis."""
    best, unsearched, fit = diagnosis.best, diagnosis.unsearched, diagnosis.fit
    if diagnosis.reason:
        return f"{diagnosis.reason}."
    if unsearched is not None:
        also = f" ({', '.join(map(str, unsearched.others))} would do so too)"
        return (
            f"{unsearched.hypothesis} predicts the trials significantly better than "
            f"{best}{also if unsearched.others else ''}; add {unsearched.kind} to --kinds."
        )
    listed = ", ".join(
        f"{name} ({_excess(excess)})" for name, excess in (fit.joints if fit else {}).items()
    )
    joints = f" Joints that the healthy trials predict better: {listed}." if listed else ""
    if joints and fit and not is_too_high(fit):
        return (
            f"{best} predicts the trials as a whole, and not all joints.{joints} There is a fault "
            f"of a kind that was not searched (--kinds), or a combination of faults."
        )
    return (
        f"even {best} predicts the trials significantly worse than the self-model predicts the "
        f"healthy robot; there is another fault, or one of a kind that was not searched "
        f"(--kinds).{_residual(diagnosis, fit) if fit else ''}{joints}"
    )


def _residual(diagnosis: Diagnosis, fit: Fit) -> str:
    """Returns the share, the signals and the time of the loss that is left, as a sentence."""
    residual = diagnosis.residual
    if residual is None:
        return ""
    amount = "Most" if fit.left is None else f"{fit.left:.0%} of the loss"
    return (
        f" {amount} is left: in {', '.join(residual.signals)}, most of it at t = "
        f"{residual.begin:.1f} to {residual.end:.1f} s of {residual.trial}."
    )
