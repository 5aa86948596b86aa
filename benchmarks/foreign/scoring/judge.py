"""Comparison of an answer of ``selfmodel diagnose --json`` with the truth of a recording."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

JAM_TOLERANCE = 0.1
"""Largest error of the angle of a jam that counts as right, rad."""

MATTERS = 0.1
"""Smallest change of the displacement, relative to the healthy one, by which a fault matters."""

_PREFIX = re.compile(r"[a-z]+")
_NUMBER = re.compile(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?")

_ANGLES = ("jam", "slope", "encoder-offset", "encoder-slip")
"""Names in ``Terms`` of the kinds whose severities are angles."""

_NAMES = {"encoder-offset-slip": "encoder-slip"}
"""Names of kinds other than keyword and prefix, joined by a hyphen."""

Terms = dict[tuple[str, str], float | None]
"""Severity of each fault by name and part; None without a severity. The name is that of the kind,
and ``jam`` for a jam at any angle."""


@dataclass(frozen=True)
class Judgement:
    """Properties of one answer; those that do not apply are None.

    Attributes:
        right: Whether the first hypothesis has the true kinds and parts.
        verdict_right: Whether the verdict is right: ``intact`` or ``explained`` for a healthy
            robot; ``explained`` with the truth first or ``ambiguous`` with the truth named for
            faults of the considered kinds; ``unexplained`` otherwise.
        false_alarm: Whether a healthy robot is called damaged or unexplained.
        called_intact: Whether a damaged robot is called intact.
        invented: Whether the first hypothesis contains a fault that is not there.
        severity_error: Largest error of a severity, relative to the true one; rad for angles.
        onset_error: Error of the time of the change, s.
        onset_found: Whether a change in mid-trial is reported.
        seconds: Time of the command, s.
    """

    right: bool | None
    verdict_right: bool
    false_alarm: bool | None
    called_intact: bool | None
    invented: bool
    severity_error: float | None
    onset_error: float | None
    onset_found: bool | None
    seconds: float


def judged(row: dict[str, Any]) -> Judgement:
    """Returns the judgement of a row of the scores; an error counts as wrong."""
    truth, answer = row["truth"], row["answer"]
    real, healthy = terms(truth["truth"]), not truth["truth"]
    if answer is None:
        return Judgement(
            right=False,
            verdict_right=False,
            false_alarm=True if healthy else None,
            called_intact=None if healthy else False,
            invented=False,
            severity_error=None,
            onset_error=None,
            onset_found=False if truth["onset"] else None,
            seconds=row["seconds"],
        )
    verdict, best = answer["verdict"], terms(answer["diagnosis"][0]["hypothesis"].split("+"))
    expressible = is_expressible(real, answer["kinds"])
    named = [best, *(terms(rival.split("+")) for rival in _rivals(answer))]
    onset = _reported_onset(answer)
    right = agrees(best, real)
    if healthy:
        verdict_right = not best and verdict in ("explained", "intact")
    elif expressible:
        verdict_right = (verdict == "explained" and right) or (
            verdict == "ambiguous" and any(agrees(one, real) for one in named)
        )
    else:
        verdict_right = verdict == "unexplained"
    said_intact = not best and verdict != "unexplained"
    return Judgement(
        right=right if expressible else None,
        verdict_right=verdict_right,
        false_alarm=(bool(best) or verdict == "unexplained") if healthy else None,
        called_intact=None if healthy else said_intact,
        invented=bool(set(best) - set(real)),
        severity_error=_severity_error(best, real) if right else None,
        onset_error=abs(onset - truth["onset"]) if truth["onset"] and onset is not None else None,
        onset_found=onset is not None if truth["onset"] else None,
        seconds=row["seconds"],
    )


def terms(faults: Iterable[str]) -> Terms:
    """Returns the terms of a notation; the place of a payload is no part of its kind."""
    found: Terms = {}
    for fault in faults:
        head, _, value = fault.partition("=")
        keyword, _, part = head.partition(":")
        number = _NUMBER.search(value)
        if keyword != "intact":
            prefix = _PREFIX.match(value)  # the kind of sensor:NAME=gain0.5 is not sensor:NAME's
            name = f"{keyword}-{prefix[0]}" if prefix else keyword
            name = _NAMES.get(name, name)
            found[name, "" if keyword == "payload" else part] = float(number[0]) if number else None
    return found


def agrees(guess: Terms, real: Terms) -> bool:
    """Returns whether kinds and parts are equal, and the angles of jams within the tolerance."""
    return guess.keys() == real.keys() and all(
        abs((guess[key] or 0.0) - (real[key] or 0.0)) <= JAM_TOLERANCE
        for key in real
        if key[0] == "jam"
    )


def is_expressible(real: Terms, kinds: Iterable[str]) -> bool:
    """Returns whether the considered kinds have the faults."""
    considered = set(kinds)

    def kind(name: str, severity: float | None) -> str:
        return "jam-angle" if name == "jam" and severity else name

    return all(kind(name, severity) in considered for (name, _), severity in real.items())


def matters(truth: dict[str, Any]) -> bool:
    """Returns whether the faults changed the displacement by a tenth or more."""
    healthy, after = (
        np.array(truth[key]) for key in ("displacement_healthy", "displacement_after")
    )
    return bool(np.linalg.norm(after - healthy) >= MATTERS * np.linalg.norm(healthy))


def _severity_error(best: Terms, real: Terms) -> float | None:
    errors = []
    for key, severity in real.items():
        guess = best[key]
        if severity is not None and guess is not None:
            scale = 1.0 if key[0] in _ANGLES else abs(severity)
            errors.append(abs(guess - severity) / scale)
    return max(errors) if errors else None


def _rivals(answer: dict[str, Any]) -> list[str]:
    return [
        rival["hypothesis"] if isinstance(rival, dict) else rival
        for rival in answer.get("indistinguishable", [])
    ]


def _reported_onset(answer: dict[str, Any]) -> float | None:
    """Returns the time of the change that an answer reports, s."""
    change = answer.get("change")
    return float(change["time"]) if change else None


def summary(row: dict[str, Any]) -> str:
    """Returns a row as one line: its name, the truth, and the answer."""
    truth = "+".join(row["truth"]["truth"]) or "intact"
    if row["answer"] is None:
        return f"{row['name']}: {truth}: error: {row['error'].strip()[-200:]}"
    best = row["answer"]["diagnosis"][0]
    mark = "right" if judged(row).verdict_right else "WRONG"
    return (
        f"{row['name']}: {truth}: {best['hypothesis']} ({best['distance']:.4g}), "
        f"{row['answer']['verdict']}, {mark}, {row['seconds']:.0f} s"
    )
