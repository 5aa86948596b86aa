"""A recovery's journal as a folder: a log a trial, and the diagnoses."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis, UnsearchedFault, Verdict
from selfmodel.errors import InputError
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import KINDS
from selfmodel.logs.errors import CorruptError, SchemaMismatchError
from selfmodel.logs.files import replace
from selfmodel.logs.reader import read_log
from selfmodel.logs.records import checked_name
from selfmodel.logs.writer import write_trial
from selfmodel.physical.interface import PhysicalRobot, TimedRobot
from selfmodel.recovery.database import Database
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.trial import Stage, Trial, TrialPlan

TRIALS = "trials"
DIAGNOSES = "diagnoses.json"

EVERY_KIND = tuple(KINDS.values())
"""What diagnoses may name, where no kinds of a third party are among it."""


@dataclass(frozen=True, eq=False)
class FolderJournal:
    """Keeps a recovery in a folder; ``open_journal`` makes it.

    See ``selfmodel.recovery.database.Journal``.

    Attributes:
        folder: ``trials/NAME.mcap`` for each trial, and ``diagnoses.json``.
        robot: Whose recovery it is.
        settings: The paper's numbers, for the record.
        kinds: Those that its diagnoses may name.
    """

    folder: Path
    robot: Robot
    settings: Settings
    _hidden: Mapping[Stage, str] = field(repr=False)
    _gap: str | None = field(default=None, repr=False)
    _kinds: Sequence[FaultKind] = field(default=EVERY_KIND, repr=False)

    def record(self, physical: PhysicalRobot, plan: TrialPlan) -> Trial:
        """Runs a trial, logs it while it runs, and returns it as its file says it.

        Raises:
            InputError: The plan's name cannot name a file, or names one that exists.
            LogError: The robot stopped early, or the file does not say what was written.
            LogWriteError: The disk is full, or failed.
        """
        path = write_trial(
            self.folder / TRIALS / f"{checked_name(plan.name)}.mcap",
            self.robot,
            plan,
            physical.run(plan.controller, plan.steps),
            timed=isinstance(physical, TimedRobot),
            settings=self.settings,
            hidden=self._hidden.get(plan.stage),
            gap=self._gap,
        )
        return read_log(path).trial

    def note(self, diagnosis: Diagnosis) -> None:
        """Keeps a diagnosis beside the earlier ones."""
        kept = _read_diagnoses(self.folder, self.robot.anatomy, self._kinds)
        texts = [_as_json(each) for each in (*kept, diagnosis)]
        replace(self.folder / DIAGNOSES, json.dumps(texts, indent=1, allow_nan=False).encode())

    def read(self) -> Database:
        """Returns everything kept so far, read from the files and checked."""
        return read_database(self.folder, self.robot.anatomy, self._kinds)


def open_journal(
    folder: Path,
    robot: Robot,
    settings: Settings,
    hidden: Mapping[Stage, str],
    *,
    gap: str | None = None,
    kinds: Sequence[FaultKind] = EVERY_KIND,
) -> FolderJournal:
    """Makes the folder of a new run.

    Args:
        folder: New, or empty.
        robot: Whose recovery it is.
        settings: The paper's numbers, for the record.
        hidden: What is wrong with the physical robot at each stage, in notation, for those who
            score: it goes into the logs and nowhere else. A stage that is missing has none.
        gap: How else the physical robot differs from its model at every stage, as JSON, likewise.
        kinds: Those that its diagnoses may name.

    Raises:
        InputError: The folder holds something, or cannot be made.
    """
    try:
        holds = sorted(entry.name for entry in folder.iterdir()) if folder.exists() else []
    except NotADirectoryError:
        raise InputError(f"{folder} is a file: choose a folder for the run") from None
    if holds:
        raise InputError(
            f"{folder} holds another run or other files ({', '.join(holds[:3])}): nothing is "
            f"overwritten, choose a folder that is empty or does not exist"
        )
    try:
        (folder / TRIALS).mkdir(parents=True)
    except OSError as error:
        raise InputError(
            f"{folder} cannot be made: {error.strerror}; choose another folder"
        ) from error
    return FolderJournal(folder, robot, settings, dict(hidden), gap, tuple(kinds))


def read_database(
    folder: Path, anatomy: Anatomy, kinds: Sequence[FaultKind] = EVERY_KIND
) -> Database:
    """Returns what the folder of a run holds: every finished trial and every diagnosis.

    A ``.part``, which is a trial that was interrupted, is passed over.

    Args:
        folder: As ``FolderJournal`` keeps it.
        anatomy: The robot's parts, to read the hypotheses.
        kinds: Those that its diagnoses may name.

    Raises:
        InputError: There is no such run.
        LogError: A file is damaged, or of another robot.
    """
    if not (folder / TRIALS).is_dir():
        raise InputError(f"{folder}: expected the folder of a run, with a folder {TRIALS} in it")
    # recover's names begin with their number, of two digits or more: shorter ones come first.
    paths = sorted((folder / TRIALS).glob("*.mcap"), key=_number)
    trials = tuple(read_log(path).trial for path in paths)
    for trial in trials:
        if trial.behaviour.names != anatomy.names:
            raise SchemaMismatchError(
                trial.path,
                f"it is of the robot {trial.robot!r}, with other sensors, motors or hinges",
                advice="give the folder of a run of one robot",
            )
    return Database(trials, _read_diagnoses(folder, anatomy, kinds))


def _number(path: Path) -> tuple[int, str]:
    digits = path.stem.partition("-")[0]
    return (int(digits) if digits.isdecimal() else 0, path.name)


def _as_json(diagnosis: Diagnosis) -> dict[str, Any]:
    return {
        "trials": diagnosis.trials,
        "intact_distance": _finite(diagnosis.intact_distance),
        "rivals": [str(rival) for rival in diagnosis.indistinguishable],
        "unseen": [str(one) for one in diagnosis.undetectable],
        "verdict": diagnosis.verdict,
        "test": diagnosis.test,
        "outside": diagnosis.unsearched.as_object() if diagnosis.unsearched else None,
        "ranked": [
            {
                "hypothesis": str(candidate.hypothesis),
                "distance": _finite(candidate.distance),
            }
            for candidate in diagnosis.ranked
        ],
    }


def _finite(distance: float) -> float | None:
    """JSON has no infinity, which is the distance of a simulation that diverged."""
    return distance if math.isfinite(distance) else None


def _read_finite(distance: float | None) -> float:
    return math.inf if distance is None else float(distance)


def _read_outside(
    item: Any,  # noqa: ANN401  # JSON
    anatomy: Anatomy,
    kinds: Sequence[FaultKind],
) -> UnsearchedFault | None:
    if item is None:
        return None
    return UnsearchedFault(parse(item["hypothesis"], anatomy, kinds), str(item["kind"]))


def _read_verdict(text: str) -> Verdict:
    verdicts: tuple[Verdict, ...] = get_args(Verdict)
    found = next((known for known in verdicts if known == text), None)
    if found is None:
        raise ValueError(f"verdict must be one of {', '.join(verdicts)}, got {text!r}")
    return found


def _read_diagnoses(
    folder: Path, anatomy: Anatomy, kinds: Sequence[FaultKind]
) -> tuple[Diagnosis, ...]:
    path = folder / DIAGNOSES
    try:
        items: Any = json.loads(path.read_bytes())
        return tuple(
            Diagnosis(
                ranked=tuple(
                    Candidate(
                        parse(candidate["hypothesis"], anatomy, kinds),
                        _read_finite(candidate["distance"]),
                    )
                    for candidate in item["ranked"]
                ),
                trials=int(item["trials"]),
                intact_distance=_read_finite(item["intact_distance"]),
                indistinguishable=tuple(parse(rival, anatomy, kinds) for rival in item["rivals"]),
                verdict=_read_verdict(item["verdict"]),
                test=str(item["test"]),
                unsearched=_read_outside(item.get("outside"), anatomy, kinds),
                undetectable=tuple(parse(one, anatomy, kinds) for one in item.get("unseen", ())),
            )
            for item in items
        )
    except FileNotFoundError:
        return ()
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise CorruptError(
            path,
            f"expected the diagnoses of a run: {error or type(error).__name__}",
            advice="move it away; the diagnoses can be made again from the trials",
        ) from error
