"""A diagnosis as sentences."""

import math
import re
from collections.abc import Sequence

from selfmodel.diagnosis.adequacy import LONGER, is_too_high
from selfmodel.diagnosis.diagnosis import DetectableSeverity, Diagnosis, Doubt, Fit
from selfmodel.diagnosis.direct_evidence import DirectEvidence
from selfmodel.diagnosis.significance import LOSS_RATIO, NEGLIGIBLE_LOSS
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.registry import KIND_SETS, KINDS

MAX_NAMED = 3
"""Causes that a summary names."""

MIN_GUESS = 0.1
"""Probability from which a summary names a cause that is not the most probable: 1 in 10."""

SURE = 0.8
"""Probability from which a summary advises to do nothing about a robot without a fault: 4 in 5."""

UNKNOWN = "look over the whole robot: no kind of fault that can be simulated explains its logs"

MEND = "mend it, or evolve a controller for the robot as it is (selfmodel.evolve)"

EARLIER = "check the earlier fault, which may come back"

NO_DOUBT = Doubt("the diagnosis does not say why", "record a healthy robot moving like this one")

OUTSIDE = {*KIND_SETS["environment"], KINDS["crosswind"], KINDS["roughness"]}  # not of the robot

SIGMA = "\u03c3"  # standard errors

_SEVERITY = re.compile(r"=([a-z]*)[^=]*$")  # the prefix belongs to the kind, the number does not


def summary(diagnosis: Diagnosis) -> tuple[str, str]:
    """Returns what is wrong, how sure that is and since when; and, as a second line, what to do."""
    facts, action = _answer(diagnosis)
    if (change := diagnosis.change) is not None:
        when = f"{change.time:.1f} s into the log '{change.trial}'"
        if change.before or diagnosis.verdict == "not judged":
            earlier = change.before.words
            facts[:1] = [f"until about {when}: {earlier}", f"after that: {facts[0]}"]
        else:
            facts.append(f"this began about {when}")
    return " ".join(f"{one[0].upper()}{one[1:]}." for one in facts), f"What to do: {action}."


def _answer(diagnosis: Diagnosis) -> tuple[list[str], str]:
    """Returns what is wrong and how sure that is, as clauses, and what to do."""
    best, fit, probability = diagnosis.best, diagnosis.fit, diagnosis.probability
    sure = _sure(diagnosis, probability.get(str(best)))
    again = LONGER
    if fit is None or fit.healthy_loss is None:
        again = "repeat the diagnosis with a log of the healthy robot (--healthy FILE)"
    match diagnosis.verdict:
        case "intact":
            what = f"nothing is wrong that is large enough to show in these logs{sure}"
            was_faulty = diagnosis.change and diagnosis.change.before
            is_sure = probability.get(str(best), 0.0) >= SURE
            action = f"nothing. To find smaller faults, {again}" if is_sure else again
            return [what], EARLIER if was_faulty else action
        case "explained":
            is_outside = OUTSIDE.issuperset(fault.kind for fault in best.faults)
            robot = "nothing is wrong with the robot itself: " if is_outside else ""
            mend = "nothing is to be done" if is_outside else MEND
            is_so, is_not = (
                ("whether this is so. If it is", "If not")
                if len(best) == 1
                else ("each. If all are so", "If one is not")
            )
            return [robot + best.words + sure], f"check {is_so}, {mend}. {is_not}, {again}"
        case "ambiguous":
            facts, checks = _alternatives(diagnosis)
            failed = "none of these is" if len(checks) > 1 else "it is not"
            return facts, f"check {', then '.join(checks)}. If {failed} so, {again}"
        case "unexplained" if diagnosis.reason:
            action = "check the robot model (--robot), and the logs' units (rad, m, s) and odometry"
            return ["no diagnosis: every simulation with this robot model becomes unstable"], action
        case "unexplained":
            return _unexplained(diagnosis)
        case "not judged":
            doubt = diagnosis.doubt or NO_DOUBT
            unknown = "it is not known whether the robot has a fault"
            why = "an error in the simulation model could explain these logs too"
            return [doubt.words] if doubt.words else [unknown, why], doubt.remedy


def _alternatives(diagnosis: Diagnosis) -> tuple[list[str], list[str]]:
    """Returns the faults of all alternatives and what each adds, as clauses, and what to check.

    Without such faults, the alternatives with their probabilities.
    """
    probability = diagnosis.probability
    alike = [diagnosis.best, *diagnosis.indistinguishable]
    alike.sort(key=lambda one: -probability.get(str(one), 0.0))
    shared = set.intersection(*(set(one.faults) for one in alike))
    common = Hypothesis(tuple(sorted(shared)))
    causes, checks = [], [f"whether {common.words}"] if shared else []
    for number, one in enumerate(alike[:MAX_NAMED], start=1):
        own = Hypothesis(tuple(fault for fault in one.faults if fault not in shared))
        words = own.words if own or not shared else "nothing else is wrong"
        causes.append(words if shared else words + _likely(probability.get(str(one))))
        checks += [f"({number})"] if own else []
    if probability and not shared:
        rest = 1 - sum(probability.get(str(one), 0.0) for one in alike[:MAX_NAMED])
        causes.append(f"something else{_likely(rest)}")
    elif len(alike) > MAX_NAMED:
        others = len(alike) - MAX_NAMED
        causes.append(f"one of {others} others" if others > 1 else "another one")
    numbered = "; ".join(f"({number}) {cause}" for number, cause in enumerate(causes, start=1))
    if not shared:
        return [f"one of these is true: {numbered}"], checks
    having = [p for one, p in probability.items() if _faults(str(common)) <= _faults(one)]
    what = common.words + _sure(diagnosis, sum(having) if having else None)
    return [what, f"in addition, one of these is true: {numbered}"], checks


def _sure(diagnosis: Diagnosis, probability: float | None) -> str:
    if probability is not None:
        wrong = max(1, round(100 * (1 - probability)))
        return f" ({100 - wrong} % sure: about {wrong} of 100 such answers are wrong)"
    if diagnosis.fit is None or diagnosis.fit.healthy_loss is None:
        return " (a log of the healthy robot is needed to say how sure this is)"
    return " (it is not known how sure this is)"


def _likely(probability: float | None) -> str:
    if probability is None:
        return ""
    return f" ({'< 1' if probability < 0.01 else f'{100 * probability:.0f}'} % likely)"


def _unexplained(diagnosis: Diagnosis) -> tuple[list[str], str]:
    best, unsearched, fit = diagnosis.best, diagnosis.unsearched, diagnosis.fit
    probability = diagnosis.probability.get(str(best))
    rest = 1 - sum(diagnosis.probability.values()) if diagnosis.probability else None
    what = "probably something is wrong that is not among the faults that were tried"
    facts = [what + _sure(diagnosis, rest)]
    has_guess = bool(best) if probability is None else probability >= MIN_GUESS
    facts += [f"or {best.words}{_likely(probability)}"] if has_guess else []
    kinds = f"all kinds of faults (--kinds all). If this was done, {UNKNOWN}"
    first = f"check whether {best.words}. If not, " if best and has_guess else ""
    if unsearched is not None:
        kind = unsearched.kind
        kinds = f"this kind of fault too (add {kind} to --kinds; default,{kind} if none were given)"
        better = "a kind of fault that was not asked for fits these logs best. Check whether"
        first = f"{better} {unsearched.hypothesis.words}. Then "
    elif fit and fit.joints:
        first = f"check the joint {next(iter(fit.joints))}, where log and model differ most. Then "
    return facts, f"{first}repeat the diagnosis with {kinds}"


def verdict_sentences(diagnosis: Diagnosis) -> str:
    """Returns the verdict, the change, further kinds and undetectable faults as sentences."""
    sentences = [_verdict(diagnosis)]
    if diagnosis.change is not None:
        sentences.append(f"C{str(diagnosis.change)[1:]}.")
    if diagnosis.also_searched:
        also = "Searched beyond the kinds asked for, to predict the trials better"
        sentences.append(f"{also}: {', '.join(diagnosis.also_searched)}.")
    if diagnosis.left_out:
        listed = ", ".join(map(str, diagnosis.left_out))
        sentences.append(f"Left out, because a refit of the self-model explains as much: {listed}.")
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
    limit = f"limit {fit.threshold:g} {SIGMA}, or {LOSS_RATIO:g} times that loss"
    return (
        f"Residual {_excess(fit.excess)} above the expected loss ({limit}); {losses}, expected "
        f"{_number(fit.healthy_loss)}."
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
        parts.setdefault(limits or "no severity", []).append(row.part or "centre of mass")
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
            others = f"{', '.join(map(str, diagnosis.indistinguishable))} ({diagnosis.test})"
            return f"Ambiguous: the trials do not distinguish {best} from {others}."
        case "unexplained":
            return f"Unexplained: {_missing(diagnosis)}"
        case "not judged":
            doubt = diagnosis.doubt or NO_DOUBT
            cause = ", so that a fault and an error of the self-model cannot be told apart"
            return f"Not judged: {doubt.reason}{'' if doubt.words else cause}."


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
