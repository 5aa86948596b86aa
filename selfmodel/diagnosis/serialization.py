"""JSON forms of a diagnosis: of a run's ``diagnoses.json`` and of ``--json`` output.

The keys are a published format, in this order. Both forms have the same values but for ``unseen``,
the undetectable faults: ``diagnoses.json`` contains whole hypotheses, which can be parsed back, and
``--json`` output only the faults that the best hypothesis lacks.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, get_args

from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis, UnsearchedFault, Verdict
from selfmodel.faults.hypothesis import Hypothesis


def diagnosis_to_dict(diagnosis: Diagnosis) -> dict[str, Any]:
    """Returns a diagnosis as JSON values, as in ``diagnoses.json``."""
    confidence = confidence_to_dict(diagnosis)
    return {
        "trials": diagnosis.trials,
        "intact_distance": confidence["intact_distance"],
        "rivals": confidence["rivals"],
        "unseen": [str(hypothesis) for hypothesis in diagnosis.undetectable],
        "verdict": confidence["verdict"],
        "test": confidence["test"],
        "outside": confidence["outside"],
        "ranked": ranking_to_list(diagnosis.ranked),
    }


def confidence_to_dict(diagnosis: Diagnosis) -> dict[str, Any]:
    """Returns the verdict and the alternatives to the best hypothesis, as in ``--json`` output."""
    return {
        "verdict": diagnosis.verdict,
        "rivals": [str(hypothesis) for hypothesis in diagnosis.indistinguishable],
        "unseen": [_extra(hypothesis, diagnosis.best) for hypothesis in diagnosis.undetectable],
        "test": diagnosis.test,
        "outside": diagnosis.unsearched.as_object() if diagnosis.unsearched else None,
        "intact_distance": _to_json(diagnosis.intact_distance),
    }


def ranking_to_list(ranked: Sequence[Candidate]) -> list[dict[str, Any]]:
    """Returns hypotheses with their distances as JSON values; null where a simulation diverged."""
    return [
        {"hypothesis": str(candidate.hypothesis), "distance": _to_json(candidate.distance)}
        for candidate in ranked
    ]


def diagnosis_from_dict(values: Mapping[str, Any], parse: Callable[[str], Hypothesis]) -> Diagnosis:
    """Returns the diagnosis that ``diagnosis_to_dict`` wrote.

    Args:
        values: JSON values. ``outside`` and ``unseen`` are optional: earlier files lack them.
        parse: Reads the notation of a hypothesis.

    Raises:
        ValueError: A hypothesis, a number or the verdict is invalid.
        KeyError: A key is missing.
        TypeError: A value has another type.
        AttributeError: A hypothesis is not a string.
    """
    outside = values.get("outside")
    return Diagnosis(
        ranked=tuple(
            Candidate(parse(item["hypothesis"]), _from_json(item["distance"]))
            for item in values["ranked"]
        ),
        trials=int(values["trials"]),
        intact_distance=_from_json(values["intact_distance"]),
        indistinguishable=tuple(parse(text) for text in values["rivals"]),
        verdict=_verdict(values["verdict"]),
        test=str(values["test"]),
        unsearched=outside
        if outside is None
        else UnsearchedFault(parse(outside["hypothesis"]), str(outside["kind"])),
        undetectable=tuple(parse(text) for text in values.get("unseen", ())),
    )


def _extra(hypothesis: Hypothesis, best: Hypothesis) -> str:
    """The faults of a hypothesis that the best one lacks, in notation."""
    return str(Hypothesis(tuple(fault for fault in hypothesis.faults if fault not in best.faults)))


def _to_json(distance: float) -> float | None:
    """JSON has no infinity, which is the distance of a simulation that diverged."""
    return distance if math.isfinite(distance) else None


def _from_json(distance: float | None) -> float:
    return math.inf if distance is None else float(distance)


def _verdict(text: str) -> Verdict:
    verdicts: tuple[Verdict, ...] = get_args(Verdict)
    found = next((verdict for verdict in verdicts if verdict == text), None)
    if found is None:
        raise ValueError(f"verdict must be one of {', '.join(verdicts)}, got {text!r}")
    return found
