"""The first sentences of a report: what happened."""

from collections.abc import Mapping, Sequence
from typing import Any

from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.diagnosis.sentences import confidence_sentence, fit_sentence
from selfmodel.diagnosis.serialization import confidence_to_dict, ranking_to_list
from selfmodel.recovery.scores.fitness import DISPLACEMENT
from selfmodel.recovery.scores.upright import UPRIGHT
from selfmodel.report.subject import Subject


def headline(subject: Subject) -> str:
    """Returns what happened, in one sentence."""
    verdict = _verdict(subject.diagnosis)
    if subject.result is None:
        count = len(subject.damaged)
        trials = f"{count} {'trial' if count == 1 else 'trials'}"
        return f"{trials} of the {subject.robot.name}: it {verdict}."
    score = subject.result.score
    before, after, recovered = (
        f"{value:.3g} {score.unit}".rstrip()
        for value in (score.before, score.after, score.recovered)
    )
    is_distance = score.name in (DISPLACEMENT.name, UPRIGHT.name)
    name = "" if is_distance else f" ({score.name})"
    achieved = "moved" if is_distance else "scored"
    fall = ", and fell" if subject.result.fell else ""
    trials_since = subject.result.physical_trials
    since = f"{trials_since} {'trial' if trials_since == 1 else 'trials'}"
    return (
        f"The {subject.robot.name} {achieved} {before}{name} before the failure and {after} after "
        f"it; it {verdict}, and {achieved} {recovered} at best in {since} since{fall}."
    )


def details(subject: Subject) -> tuple[str, ...]:
    """Returns the sentences of the verdict, and the truth where it is known."""
    diagnosis = subject.diagnosis
    found: Mapping[str, Any] = {
        **confidence_to_dict(diagnosis),
        "diagnosis": ranking_to_list(diagnosis.ranked),
    }
    sentences = [confidence_sentence(found), fit_sentence(found)]
    if subject.result is not None:
        gap = f", at a reality gap of {subject.result.gap:g}" if subject.result.gap else ""
        judgement = f"the diagnosis is {subject.result.judgement}"
        sentences.append(f"True faults: {subject.result.truth}{gap}; {judgement}.")
    return tuple(sentence for sentence in sentences if sentence)


def _verdict(diagnosis: Diagnosis) -> str:
    match diagnosis.verdict:
        case "intact":
            return "is healthy: no fault is needed to predict its trials"
        case "explained":
            return f"has the fault {diagnosis.best}, which explains its trials"
        case "ambiguous":
            return f"has {_alternatives([diagnosis.best, *diagnosis.indistinguishable])}"
    return f"moves in a way that no searched hypothesis explains; the nearest is {diagnosis.best}"


def _alternatives(hypotheses: Sequence[object]) -> str:
    shown = [str(one) for one in hypotheses[:3]]
    more = len(hypotheses) - len(shown)
    return " or ".join(shown) + (f" or one of {more} others" if more else "")
