"""Diagnoses of recordings by the command line of selfmodel, and the rates of right answers."""

import dataclasses
import hashlib
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.foreign.cases import CASES, GROUPS
from benchmarks.foreign.generate import MATTERS
from benchmarks.foreign.model import LEVELS
from benchmarks.rows import markdown, rate, read_rows
from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.studies.study import Row

LIMIT = 1800
"""Longest time of one command, s."""

JAM_TOLERANCE = 0.1
"""Largest error of the angle of a jam that counts as right, rad."""

ANGLES = ("jam", "slope", "encoder-offset", "encoder-slip")
"""Names in ``Terms`` of the kinds whose severities are angles."""

Terms = dict[tuple[str, str], float | None]
"""Severity of each fault by name and part; None without a severity. The name is that of the kind,
and ``jam`` for a jam at any angle."""


@dataclass(frozen=True)
class Question:
    """How a recording is diagnosed: ``--kinds``, trials with the faults, further options."""

    kinds: str = ""
    trials: int = 1
    options: tuple[str, ...] = ()


QUESTIONS = {
    "paper": Question("break,jam,sensor"),
    "healthy": Question(),
    "wide": Question("all"),
    "default": Question(trials=3),
    "onset": Question(),
    "lost-encoder": Question("break,jam,sensor"),
    "long": Question("default,grip"),
    "outside": Question(),
}
"""Question of each group."""


def score(
    out: Path, rows: Path, question_of: Callable[[str], Question], jobs: int
) -> Iterator[Row]:
    """Diagnoses every recording of a folder that has no row yet, and appends the rows.

    The order is that of the names' digests, so that the rows of an interrupted run are a sample.
    ``question_of`` returns how the recordings of a group are diagnosed.
    """

    def key(name: str, asked: Row) -> str:
        return name + json.dumps(asked, sort_keys=True)

    def digest(path: Path) -> str:
        return hashlib.sha256(path.parent.name.encode()).hexdigest()

    known = read_rows(rows) if rows.exists() else []
    done = {key(row["name"], row["asked"]) for row in known}
    left = []
    for path in sorted(out.glob("*/truth.json"), key=digest):
        question = question_of(json.loads(path.read_text())["group"])
        if key(path.parent.name, dataclasses.asdict(question)) not in done:
            left.append((path.parent, question))
    with ThreadPoolExecutor(jobs) as pool, rows.open("a") as file:
        for future in as_completed([pool.submit(_diagnosed, *asked) for asked in left]):
            file.write(json.dumps(future.result()) + "\n")
            file.flush()
            yield future.result()


def _diagnosed(folder: Path, question: Question) -> Row:
    """Imports and diagnoses one recording.

    The row has its name and truth, how it was diagnosed (``asked``), the answer of ``diagnose`` or
    None, the error, and the seconds of the diagnosis. A recording with a gait of its own has two
    healthy trials and one to explain.
    """
    row: Row = {
        "name": folder.name,
        "truth": json.loads((folder / "truth.json").read_text()),
        "asked": dataclasses.asdict(question),
        "answer": None,
        "error": "",
    }
    healthy, trials = ["before"], question.trials
    if row["truth"].get("own_gait"):
        healthy, trials = ["before", "before-2"], 1
    with tempfile.TemporaryDirectory() as logs:
        names = [*healthy, *(f"after-{k + 1}" for k in range(trials))]
        for name in names:
            log = str(Path(logs, f"{name}.mcap"))
            command = ("logs", "import", name, "--mapping", f"{name}.toml", "--out", log)
            done = _selfmodel(*command, cwd=folder)
            if done.returncode:
                return {**row, "error": done.stderr[-2000:], "seconds": 0.0}
        start = time.perf_counter()
        kinds = ("--kinds", question.kinds) if question.kinds else ()
        options = (*kinds, *question.options, "--json", "--threads", "1")
        done = _selfmodel("diagnose", *(f"{name}.mcap" for name in names), *options, cwd=Path(logs))
        row["seconds"] = time.perf_counter() - start
    if done.returncode:
        return {**row, "error": done.stderr[-2000:]}
    return {**row, "answer": json.loads(done.stdout)}


def _selfmodel(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Runs the command line of the selfmodel that is importable here."""
    here = str(Path(__file__).resolve().parents[2])
    command = [sys.executable, "-m", "selfmodel", *arguments]
    environment = {**os.environ, "PYTHONPATH": here, "OMP_NUM_THREADS": "1"}
    try:
        return subprocess.run(
            command,
            cwd=cwd,
            env=environment,
            capture_output=True,
            text=True,
            timeout=LIMIT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(command, 1, "", f"more than {LIMIT} s")


@dataclass(frozen=True)
class Judgement:
    """Properties of one answer; those that do not apply are None."""

    right: bool | None = False
    """Whether the first hypothesis has the true kinds and parts."""
    verdict_right: bool = False
    """``intact`` or ``explained`` for a healthy robot; ``explained`` with the truth first or
    ``ambiguous`` with the truth named for faults of the considered kinds; else ``unexplained``."""
    false_alarm: bool | None = None
    """Whether a healthy robot is called damaged or unexplained, and the trials are judged."""
    called_intact: bool | None = None
    """Whether a damaged robot is called intact."""
    not_judged: bool = False
    """Whether the verdict is ``not judged``."""
    invented: bool = False
    """Whether the first hypothesis contains a fault that is not there."""
    severity_error: float | None = None
    """Largest error of a severity, relative to the true one; rad for angles."""
    onset_error: float | None = None
    onset_found: bool | None = None
    seconds: float = 0.0
    probability: float | None = None
    """Probability that is stated: of the first hypothesis; for ``unexplained`` that of no one."""
    is_so: bool = False
    """Whether that is so; ``intact`` is if no fault is beyond a stated limit."""


def judged(row: Row) -> Judgement:
    """Returns the judgement of a row; an error counts as wrong."""
    truth, answer = row["truth"], row["answer"]
    real, healthy = terms(truth["truth"]), not truth["truth"]
    if answer is None:
        return Judgement(
            false_alarm=True if healthy else None,
            called_intact=None if healthy else False,
            onset_found=False if truth["onset"] else None,
            seconds=row["seconds"],
        )
    verdict, best = answer["verdict"], terms(answer["diagnosis"][0]["hypothesis"].split("+"))
    expressible, right = is_expressible(real, answer["kinds"]), agrees(best, real)
    judges = verdict != "not judged"
    onset = (answer.get("change") or {}).get("time")
    if healthy:
        verdict_right = not best and verdict in ("explained", "intact")
    elif verdict == "unexplained":
        verdict_right = not expressible
    else:
        named = [best, *(terms(other.split("+")) for other in answer.get("indistinguishable", ()))]
        among = any(agrees(one, real) for one in named)
        verdict_right = right if verdict == "explained" else verdict == "ambiguous" and among
    return Judgement(
        right=right if expressible else None,
        verdict_right=verdict_right,
        false_alarm=(bool(best) or verdict == "unexplained") and judges if healthy else None,
        called_intact=None if healthy else not best and judges and verdict != "unexplained",
        not_judged=not judges,
        invented=judges and bool(set(best) - set(real)),
        severity_error=_severity_error(best, real) if right else None,
        onset_error=abs(onset - truth["onset"]) if truth["onset"] and onset is not None else None,
        onset_found=onset is not None if truth["onset"] else None,
        seconds=row["seconds"],
        probability=_probability(answer),
        is_so=(not right) if verdict == "unexplained" else right or _is_hidden(real, answer),
    )


def _is_hidden(real: Terms, answer: Row) -> bool:
    """Returns whether the answer is ``intact``, and names each fault as too small to be seen."""
    unseen = [key for one in answer.get("undetectable", ()) for key in terms(one.split("+"))]
    limits = {
        (one["kind"], one["part"]): (
            -math.inf if one["below"] is None else one["below"],
            math.inf if one["above"] is None else one["above"],
        )
        for one in answer.get("detectable") or ()
    }
    return answer["verdict"] == "intact" and all(
        key in unseen or (key in limits and limits[key][0] < (severity or 0.0) < limits[key][1])
        for key, severity in real.items()
    )


def _probability(answer: Row) -> float | None:
    known: dict[str, float] = answer.get("probability") or {}
    if answer["verdict"] == "unexplained" and known:
        return 1 - sum(known.values())
    return known.get(answer["diagnosis"][0]["hypothesis"])


def terms(faults: Iterable[str]) -> Terms:
    """Returns the terms of a notation; the place of a payload is no part of its kind."""
    found: Terms = {}
    for fault in faults:
        head, _, value = fault.partition("=")
        keyword, _, part = head.partition(":")
        number = re.search(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", value)
        if keyword != "intact":
            prefix = re.match("[a-z]+", value)  # sensor:NAME=gain0.5 is of the kind sensor-gain
            name = f"{keyword}-{prefix[0]}" if prefix else keyword
            name = {"encoder-offset-slip": "encoder-slip", "leg-locked": "leg"}.get(name, name)
            number = None if name == "leg" else number  # a leg has angles
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
    return all(
        ("jam-angle" if name == "jam" and severity else name) in considered
        for (name, _), severity in real.items()
    )


def _severity_error(best: Terms, real: Terms) -> float | None:
    errors = [
        abs(guess - severity) / (1.0 if key[0] in ANGLES else abs(severity))
        for key, severity in real.items()
        if severity is not None and (guess := best[key]) is not None
    ]
    return max(errors, default=None)


def _matters(truth: Row) -> bool:
    """Returns whether the faults changed the displacement by a tenth or more."""
    healthy, after = map(np.array, (truth["displacement_healthy"], truth["displacement_after"]))
    return bool(np.linalg.norm(after - healthy) >= MATTERS * np.linalg.norm(healthy))


def summary(row: Row) -> str:
    """Returns a row as one line: its name, the truth, and the answer."""
    truth = "+".join(row["truth"]["truth"]) or "intact"
    if row["answer"] is None:
        return f"{row['name']}: {truth}: error: {row['error'].strip()[-200:]}"
    best = row["answer"]["diagnosis"][0]
    found = judged(row)
    mark = "right" if found.verdict_right else "no answer" if found.not_judged else "WRONG"
    return (
        f"{row['name']}: {truth}: {best['hypothesis']} ({best['distance']:.4g}), "
        f"{row['answer']['verdict']}, {mark}, {row['seconds']:.0f} s"
    )


HEADINGS = {
    "right": "right first",
    "verdict_right": "verdict right",
    "false_alarm": "false alarms",
    "called_intact": "called intact",
    "not_judged": "not judged",
    "invented": "invented",
    "severity_error": "severity error",
    "onset_found": "onset found",
    "onset_error": "onset error, s",
    "seconds": "seconds",
}
"""Columns of the table: rates of truth values, medians of numbers."""

MEDIANS = ("severity_error", "onset_error", "seconds")


def table(rows: Sequence[Row], by: str) -> str:
    """Returns rates with Wilson's 95 % intervals as Markdown, by ``group`` or ``case``, and gap.

    Faults outside all kinds that change the displacement by less than a tenth are left out.
    """
    used = [row for row in rows if row["truth"]["group"] != "outside" or _matters(row["truth"])]
    lines = []
    for name in GROUPS if by == "group" else CASES:
        for gap in (*LEVELS, "all"):
            chosen = [
                judged(row)
                for row in used
                if row["truth"][by] == name and gap in (row["truth"]["gap"], "all")
            ]
            line = {by: name, "gap": gap, "recordings": str(len(chosen))}
            for key, heading in HEADINGS.items():
                found = [v for one in chosen if (v := getattr(one, key)) is not None]
                line[heading] = _median(found) if key in MEDIANS else rate(found)
            lines += [line] if chosen else []
    return markdown(lines, texts=2)


BINS = (0.0, 0.5, 0.7, 0.9, 0.95, 1.0)
"""Bounds of the stated probabilities of a row of the reliability table."""

RESAMPLES = 2000
"""Bootstrap samples of the recordings behind the interval of the calibration error."""


def reliability(rows: Sequence[Row]) -> str:
    """Returns how often what was said is so, by its probability, as Markdown.

    Below the table is the expected calibration error: the mean difference between probability and
    rate over the rows of the table, weighted by their recordings, with a 95 % interval; and that of
    probabilities that are exact, which chance makes.
    """
    found = [one for one in map(judged, rows) if one.probability is not None]
    if not found:
        return "No probabilities are stated."
    said = np.array([one.probability for one in found], dtype=float)
    so = np.array([one.is_so for one in found], dtype=float)
    place = row_of(said)
    lines = [
        {
            "probability": f"{BINS[row]:.0%} to {BINS[row + 1]:.0%}",
            "recordings": str((place == row).sum()),
            "mean probability": f"{said[place == row].mean():.1%}",
            "so": rate(so[place == row].astype(bool).tolist()),
        }
        for row in np.unique(place)
    ]
    rng = np.random.default_rng(0)
    drawn = rng.integers(len(said), size=(RESAMPLES, len(said)))
    errors = [calibration_error(said[one], so[one], place[one]) for one in drawn]
    low, high = np.quantile(errors, (0.025, 0.975))
    error = calibration_error(said, so, place)
    chosen = (rng.random((RESAMPLES, len(said))) < said).astype(float)
    exact = [calibration_error(said, one, place) for one in chosen]
    chance = f"{np.mean(exact):.1%}, and {np.quantile(exact, 0.95):.1%} or more in one of 20 cases"
    measured = f"{error:.1%} ({low:.1%} to {high:.1%})"
    return f"{markdown(lines, 1)}\nCalibration error {measured}; if they were exact, {chance}"


def row_of(said: FloatArray) -> IndexArray:
    """Returns the row of the reliability table of each probability."""
    return np.clip(np.searchsorted(BINS, said, side="right") - 1, 0, len(BINS) - 2)


def calibration_error(said: FloatArray, so: FloatArray, place: IndexArray) -> float:
    """Returns the expected calibration error of probabilities, what was so, and their rows."""
    return float(np.abs(np.bincount(place, said - so)).sum() / len(said))


def _median(values: Sequence[float]) -> str:
    return f"{np.median(values):.3g}" if values else ""


def write_csv(rows: Iterable[Row], path: Path) -> None:
    """Writes the judged answers, a line per recording."""
    lines = pd.DataFrame(map(_line, rows)).sort_values("recording", kind="stable")
    lines.to_csv(path, index=False, lineterminator="\n")


def _line(row: Row) -> Row:
    truth, answer, found = row["truth"], row["answer"] or {}, judged(row)
    fit = answer.get("fit") or {}

    def loss(key: str) -> float | None:
        return None if fit.get(key) is None else float(f"{fit[key]:.3g}")

    return {
        "recording": row["name"],
        "group": truth["group"],
        "kinds": row["asked"]["kinds"] or "default",
        "trials": row["asked"]["trials"],
        "truth": "+".join(truth["truth"]) or "intact",
        "onset": truth["onset"],
        "best": answer["diagnosis"][0]["hypothesis"] if answer else row["error"][-200:],
        "verdict": answer.get("verdict", "error"),
        "rivals": len(answer.get("indistinguishable", ())),
        "outside": (answer.get("unsearched") or {}).get("hypothesis"),
        "change": (answer.get("change") or {}).get("time"),
        "loss": loss("loss"),
        "healthy_loss": loss("healthy_loss"),
        "probability": None if found.probability is None else round(found.probability, 3),
        "so": found.is_so,
        "right": found.right,
        "verdict_right": found.verdict_right,
        "seconds": round(row.get("seconds", 0.0), 1),
    }
