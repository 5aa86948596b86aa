"""A diagnosis as sentences."""

import math
import re
from collections.abc import Sequence

from selfmodel.diagnosis.diagnosis import DetectableSeverity, Diagnosis, Doubt, Fit
from selfmodel.diagnosis.direct_evidence import DirectEvidence
from selfmodel.diagnosis.significance import LOSS_RATIO, NEGLIGIBLE_LOSS
from selfmodel.diagnosis.verdict import is_too_high
from selfmodel.faults.hypothesis import Hypothesis

MAX_NAMED = 3
"""Causes that a summary names."""

MIN_GUESS = 0.1
"""Probability from which a summary names a cause that is not the most probable: 1 in 10."""

NO_DOUBT = Doubt("the diagnosis does not say why", "record a healthy robot moving like this one")

SIGMA = "\u03c3"  # standard errors

_SEVERITY = re.compile(r"=([a-z]*)[^=]*$")  # the prefix belongs to the kind, the number does not


def summary(diagnosis: Diagnosis) -> tuple[str, str]:
    """Returns what is wrong, since when and how sure that is; and, as a second line, what to do."""
    facts, action = _answer(diagnosis)
    if (change := diagnosis.change) is not None:
        before = f". Before that: {in_words(change.before)}" if change.before else ""
        since = f"this is so from {change.time:.1f} s into the log '{change.trial}' on{before}"
        facts.insert(1, since)
    return " ".join(f"{one[0].upper()}{one[1:]}." for one in facts), f"What to do: {action}."


def _answer(diagnosis: Diagnosis) -> tuple[list[str], str]:
    """Returns what is wrong and how sure that is, as clauses, and what to do."""
    best, fit, probability = diagnosis.best, diagnosis.fit, diagnosis.probability
    sure = _sure(probability.get(str(best)))
    again = "record this robot again for twice as long, and repeat the diagnosis"
    if fit is None or fit.healthy_loss is None:
        again = "repeat the diagnosis with a log of the healthy robot (--healthy FILE)"
    match diagnosis.verdict:
        case "intact":
            action = f"nothing. To find faults too small to show in these logs, {again}"
            return ["no fault was found", sure], action
        case "explained":
            return [in_words(best), sure], f"check whether this is so. If it is not, {again}"
        case "ambiguous":
            action = f"check these, in this order. If none of them is so, {again}"
            return _alternatives(diagnosis), action
        case "unexplained" if diagnosis.reason:
            action = "check the model of the robot, and the units and the odometry of the logs"
            return ["these logs cannot be simulated"], action
        case "unexplained":
            what = "something is wrong, but none of the faults that were tried explains it"
            rest = 1 - sum(probability.values()) if probability else None
            return [what, _sure(rest)], _search_on(diagnosis)
        case "not judged":
            what = "it is not known whether the robot has a fault"
            model = "an error in its simulation model may explain these logs as well"
            return [
                what,
                model,
            ], f"{(diagnosis.doubt or NO_DOUBT).remedy}. Then repeat the diagnosis"


def in_words(hypothesis: Hypothesis) -> str:
    """Returns the faults of a hypothesis as clauses in plain words."""
    return ", and ".join(fault.words for fault in hypothesis.faults) or "nothing is wrong"


def _alternatives(diagnosis: Diagnosis) -> list[str]:
    """Returns the faults of all alternatives, how sure they are, and what each adds, as clauses.

    Without such faults, the alternatives with their probabilities.
    """
    probability = diagnosis.probability
    alike = sorted(
        [diagnosis.best, *diagnosis.indistinguishable],
        key=lambda one: -probability.get(str(one), 0.0),
    )
    shared = set.intersection(*(set(one.faults) for one in alike))
    causes = []
    for one in alike[:MAX_NAMED]:
        own = Hypothesis(tuple(fault for fault in one.faults if fault not in shared))
        words = in_words(own) if own or not shared else "nothing else is wrong"
        causes.append(words if shared else words + _likely(probability.get(str(one))))
    if probability and not shared:
        rest = 1 - sum(probability.get(str(one), 0.0) for one in alike[:MAX_NAMED])
        causes.append(f"something else{_likely(rest)}")
    elif len(alike) > MAX_NAMED:
        causes.append(f"one of {len(alike) - MAX_NAMED} others")
    numbered = "; ".join(f"({number}) {cause}" for number, cause in enumerate(causes, start=1))
    if not shared:
        return [f"one of these is true: {numbered}"]
    common = Hypothesis(tuple(sorted(shared)))
    having = [p for one, p in probability.items() if _faults(str(common)) <= _faults(one)]
    sure = _sure(sum(having) if having else None)
    return [in_words(common), sure, f"in addition, one of these is true: {numbered}"]


def _sure(probability: float | None) -> str:
    if probability is None:
        return "it is not known how sure this is"
    wrong = round(100 * (1 - probability))
    return f"{100 - wrong} % sure: about {wrong} of 100 such answers are wrong"


def _likely(probability: float | None) -> str:
    if probability is None:
        return ""
    return f" ({'< 1' if probability < 0.01 else f'{100 * probability:.0f}'} % likely)"


def _search_on(diagnosis: Diagnosis) -> str:
    """Returns what to do about a robot that none of the faults explains that were tried."""
    best, unsearched, fit = diagnosis.best, diagnosis.unsearched, diagnosis.fit
    probability = diagnosis.probability.get(str(best))
    if unsearched is not None:
        return (
            f"repeat the diagnosis with one more kind of fault (--kinds default,{unsearched.kind})"
            f". A fault of this kind fits better: {in_words(unsearched.hypothesis)}"
        )
    first = ""
    if fit and fit.joints:
        first = f"check the joint {next(iter(fit.joints))}, where the difference is largest. Then "
    elif best and (probability is None or probability >= MIN_GUESS):
        first = f"check the best guess{_likely(probability)}: {in_words(best)}. If it is not so, "
    return f"{first}repeat the diagnosis with all kinds of faults (--kinds all)"


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
