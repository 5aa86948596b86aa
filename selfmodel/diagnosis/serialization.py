"""JSON forms of a diagnosis: of a run's ``diagnoses.json`` and of ``--json`` output.

The keys are a published format, in this order. Both forms have the same values but for ``unseen``,
the undetectable faults: ``diagnoses.json`` contains whole hypotheses, which can be parsed back, and
``--json`` output only the faults that the best hypothesis lacks.
"""

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, get_args

from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis, UnsearchedFault, Verdict
from selfmodel.diagnosis.verdicts.change_point import Change
from selfmodel.diagnosis.verdicts.detectable import DetectableSeverity
from selfmodel.diagnosis.verdicts.fit import Fit
from selfmodel.diagnosis.verdicts.residual import Residual
from selfmodel.faults.hypothesis import Hypothesis


def confidence_to_dict(diagnosis: Diagnosis) -> dict[str, Any]:
    """Returns the verdict and the alternatives to the best hypothesis, as in ``--json`` output."""
    values = diagnosis.to_dict()
    extra = [_extra(hypothesis, diagnosis.best) for hypothesis in diagnosis.undetectable]
    keys = ("verdict", "rivals", "unseen", "test", "outside", "intact_distance")
    found = {key: extra if key == "unseen" else values[key] for key in keys}
    detectable = [one.to_dict() for one in diagnosis.detectable]
    return {
        **found,
        "reason": diagnosis.reason or None,
        "fit": diagnosis.fit.to_dict() if diagnosis.fit else None,
        "change": diagnosis.change.to_dict() if diagnosis.change else None,
        "residual": diagnosis.residual.to_dict() if diagnosis.residual else None,
        **({"detectable": detectable} if detectable else {}),
    }


def ranking_to_list(ranked: Sequence[Candidate]) -> list[dict[str, Any]]:
    """Returns hypotheses with their distances as JSON values; None where a simulation diverged."""
    return [candidate.to_dict() for candidate in ranked]


def diagnosis_from_dict(values: Mapping[str, Any], parse: Callable[[str], Hypothesis]) -> Diagnosis:
    """Returns the diagnosis of the values that ``Diagnosis.to_dict`` returned.

    Args:
        values: JSON values. ``outside`` and ``unseen`` are optional: earlier files lack them.
            ``reason`` is there only for a diagnosis with a reason, ``detectable`` only if
            the best hypothesis is the empty one, ``change`` only for a change in time.
        parse: Reads the notation of a hypothesis.

    Raises:
        ValueError: A hypothesis, a number or the verdict is invalid.
        KeyError: A key is missing.
        TypeError: A value has another type.
        AttributeError: A hypothesis is not a string.
    """
    outside = values.get("outside")
    ranked = tuple(
        Candidate(parse(item["hypothesis"]), _from_json(item["distance"]))
        for item in values["ranked"]
    )
    if not ranked:
        raise ValueError("expected at least one ranked hypothesis, got none")
    return Diagnosis(
        ranked=ranked,
        trials=int(values["trials"]),
        intact_distance=_from_json(values["intact_distance"]),
        indistinguishable=tuple(parse(text) for text in values["rivals"]),
        verdict=_verdict(values["verdict"]),
        test=str(values["test"]),
        unsearched=outside
        if outside is None
        else UnsearchedFault(
            parse(outside["hypothesis"]),
            str(outside["kind"]),
            {str(kind): parse(text) for kind, text in outside.get("others", {}).items()},
        ),
        undetectable=tuple(parse(text) for text in values.get("unseen", ())),
        reason=str(values.get("reason") or ""),
        detectable=tuple(_detectable(item) for item in values.get("detectable", ())),
        fit=_fit(values["fit"]) if values.get("fit") else None,
        change=_change(values["change"], parse) if values.get("change") else None,
        residual=_residual(values["residual"]) if values.get("residual") else None,
    )


def diagnosis_from_output(
    values: Mapping[str, Any], trials: int, parse: Callable[[str], Hypothesis]
) -> Diagnosis:
    """Returns the diagnosis of ``--json`` output: a ranking, and a verdict with alternatives.

    Args:
        values: JSON values; ``diagnosis`` is the ranking.
        trials: Number of trials that the diagnosis explains.
        parse: Reads the notation of a hypothesis.

    Raises:
        ValueError: A hypothesis, a number or the verdict is invalid.
        KeyError: A key is missing.
        TypeError: A value has another type.
        AttributeError: A hypothesis is not a string.
        IndexError: No hypothesis is ranked.
    """
    ranked = values["diagnosis"]
    best = parse(ranked[0]["hypothesis"])
    unseen = [str(Hypothesis((*best.faults, *parse(text).faults))) for text in values["unseen"]]
    whole = {**values, "trials": trials, "ranked": ranked, "unseen": unseen}
    return diagnosis_from_dict(whole, parse)


def _detectable(item: Mapping[str, Any]) -> DetectableSeverity:
    below, above = (
        None if item[side] is None else _from_json(item[side]) for side in ("below", "above")
    )
    return DetectableSeverity(str(item["kind"]), str(item["part"]), below, above)


def _fit(values: Mapping[str, Any]) -> Fit:
    healthy, excess = values["healthy_loss"], values["excess"]
    # Both are None without healthy trials; None beside a number is infinite.
    is_compared = healthy is not None or excess is not None
    return Fit(
        loss=_from_json(values["loss"]),
        intact_loss=_from_json(values["intact_loss"]),
        healthy_loss=_from_json(healthy) if is_compared else None,
        excess=_from_json(excess) if is_compared else None,
        threshold=_from_json(values["threshold"]),
        has_faults=bool(values["has_faults"]),
        joints={str(name): _from_json(z) for name, z in values.get("joints", {}).items()},
    )


def _residual(values: Mapping[str, Any]) -> Residual:
    return Residual(
        signals={str(name): _from_json(excess) for name, excess in values["signals"].items()},
        trial=str(values["trial"]),
        begin=_from_json(values["begin"]),
        end=_from_json(values["end"]),
    )


def _change(values: Mapping[str, Any], parse: Callable[[str], Hypothesis]) -> Change:
    return Change(
        trial=str(values["trial"]),
        index=int(values["index"]),
        time=_from_json(values["time"]),
        earliest=_from_json(values["earliest"]),
        latest=_from_json(values["latest"]),
        before=parse(values["before"]),
        after=parse(values["after"]),
    )


def _extra(hypothesis: Hypothesis, best: Hypothesis) -> str:
    """The faults of a hypothesis that the best one lacks, in notation."""
    return str(Hypothesis(tuple(fault for fault in hypothesis.faults if fault not in best.faults)))


def _from_json(distance: object) -> float:
    if distance is None:
        return math.inf
    if not isinstance(distance, (int, float)) or not abs(distance) <= sys.float_info.max:
        raise ValueError(f"expected a finite number or null as a distance, got {distance!r:.60}")
    return float(distance)


def _verdict(text: str) -> Verdict:
    verdicts: tuple[Verdict, ...] = get_args(Verdict)
    found = next((verdict for verdict in verdicts if verdict == text), None)
    if found is None:
        raise ValueError(f"verdict must be one of {', '.join(verdicts)}, got {text!r}")
    return found
