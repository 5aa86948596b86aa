"""What a log says of its trial beside the messages: metadata records and attachments."""

import dataclasses
import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from selfmodel.errors import InputError
from selfmodel.settings import Settings
from selfmodel.trials.trial import STAGES, Stage, stage_of

FORMAT = "1"
"""The version of the log's format; a reader refuses others."""

TIMED_FORMAT = "2"
"""That of a robot with a clock of its own: the same with ``/timing``."""

FORMATS = (FORMAT, TIMED_FORMAT)

TRIAL = "selfmodel.trial"
SOFTWARE = "selfmodel.software"
HIDDEN = "selfmodel.hidden"
"""The record with what a simulated physical robot hides; diagnosis never reads it."""
IMPORT = "selfmodel.import"
"""Where an imported trial comes from, and how good what was recorded is."""
SALVAGE = "selfmodel.salvage"
"""Which damaged file a salvaged trial comes from."""
RESULT = "selfmodel.result"

OWN = "selfmodel."
"""What the names of all our records begin with; each holds a digest of itself."""
DIGEST = "sha256"

MODEL_FILE = "model.xml"
CONTROLLER_FILE = "controller.npz"
SETTINGS_FILE = "settings.json"
MAPPING_FILE = "mapping.toml"

MEDIA_TYPES: Mapping[str, str] = MappingProxyType(
    {
        MODEL_FILE: "application/xml",
        SETTINGS_FILE: "application/json",
        MAPPING_FILE: "application/toml",
    }
)
"""What the attachments are; all others are bytes."""

TRUTH = "truth"
GAP = "gap"
FINISHED = "finished"
INTERRUPTED = "interrupted"
STOPPED = "stopped"

SHORTEST, LONGEST = 1e-9, 3600.0
"""Seconds that a control step may take: a log's clock ticks in nanoseconds, and ends."""

LONGEST_TEXT = 1000

_NAME = re.compile(r"[A-Za-z0-9-]{1,100}")


@dataclass(frozen=True)
class TrialRecord:
    """The record ``selfmodel.trial``, written before the trial starts.

    Attributes:
        format: Version of the log's format.
        name: The trial's name within its run.
        stage: Where in the story it stands.
        robot: The robot's name.
        root: The body that ``/odom`` tells of.
        control_timestep: Seconds between two commands; step k is at k times this.
        steps: Control steps that it is to last.
        seed: From which everything random about it is drawn.
        controller_sha256: Of the attached controller, or "" where there is none because what drove
            the robot is not known; its commands are.
        model_sha256: Of the attached model.
    """

    format: str
    name: str
    stage: Stage
    robot: str
    root: str
    control_timestep: float
    steps: int
    seed: int
    controller_sha256: str
    model_sha256: str

    def texts(self) -> dict[str, str]:
        """Returns the record as MCAP holds it."""
        return {
            name: value if isinstance(value, str) else repr(value)
            for name, value in dataclasses.asdict(self).items()
        }


@dataclass(frozen=True)
class Result:
    """The record ``selfmodel.result``, written last.

    Attributes:
        status: ``finished``, ``interrupted`` or ``stopped``.
        steps: Control steps that were logged.
        displacement: How far the robot travelled forward, m.
        reason: Why it was stopped.
    """

    status: str
    steps: int
    displacement: float
    reason: str = ""

    def texts(self) -> dict[str, str]:
        """Returns the record as MCAP holds it."""
        return {
            "status": self.status,
            "steps": str(self.steps),
            "displacement": repr(self.displacement),
            **({"reason": self.reason[:LONGEST_TEXT]} if self.reason else {}),
        }


@dataclass(frozen=True)
class Imported:
    """Where an imported trial comes from.

    Attributes:
        facts: Its source, and the quality of what was recorded, as texts by name.
        mapping: The mapping by which it was imported, as TOML.
    """

    facts: Mapping[str, str]
    mapping: str


@dataclass(frozen=True)
class TrialHeader:
    """Content of a log's preamble beside the robot and the plan.

    Attributes:
        settings: The paper's numbers, for the record.
        timed: Whether the samples have a step timing; see ``physical.interface.TimedRobot``.
        hidden: Faults of a simulated physical robot, in notation; for ``read_truth`` only.
        gap: Reality gap of a simulated physical robot, as JSON; for ``read_gap`` only.
        imported: Origin of an imported trial.
    """

    settings: Settings
    timed: bool = False
    hidden: str | None = None
    gap: str | None = None
    imported: Imported | None = None


def trial_record(texts: Mapping[str, str]) -> TrialRecord:
    """Returns the record that stands in a log.

    Raises:
        ValueError: A field is missing or cannot be what it says; the sentence names it.
    """
    fields = [field.name for field in dataclasses.fields(TrialRecord)]
    missing = [name for name in fields if name not in texts]
    if missing:
        raise ValueError(f"it lacks {', '.join(missing)}")
    stage = stage_of(texts["stage"])
    if stage is None:
        raise ValueError(f"stage must be one of {', '.join(STAGES)}, got {texts['stage']!r}")
    long = [name for name in fields if len(texts[name]) > LONGEST_TEXT]
    if long:
        raise ValueError(f"expected at most {LONGEST_TEXT} characters in {', '.join(long)}")
    timestep = float(texts["control_timestep"])
    if not SHORTEST <= timestep <= LONGEST:
        raise ValueError(
            f"control_timestep must be above 0 s, from {SHORTEST} to {LONGEST}, "
            f"got {texts['control_timestep']!r}"
        )
    return TrialRecord(
        format=texts["format"],
        name=texts["name"],
        stage=stage,
        robot=texts["robot"],
        root=texts["root"],
        control_timestep=timestep,
        steps=int(texts["steps"]),
        seed=int(texts["seed"]),
        controller_sha256=texts["controller_sha256"],
        model_sha256=texts["model_sha256"],
    )


def result_record(texts: Mapping[str, str]) -> Result:
    """Returns the record that stands in a log.

    Raises:
        ValueError: A field is missing or cannot be what it says.
    """
    missing = [name for name in ("status", "steps", "displacement") if name not in texts]
    if missing:
        raise ValueError(f"it lacks {', '.join(missing)}")
    reason = texts.get("reason", "")
    if len(reason) > LONGEST_TEXT:
        raise ValueError(f"expected at most {LONGEST_TEXT} characters in reason")
    return Result(texts["status"], int(texts["steps"]), float(texts["displacement"]), reason)


def settings_json(settings: Settings) -> bytes:
    """Returns settings as JSON."""
    return json.dumps(dataclasses.asdict(settings), indent=1).encode()


def parse_settings(data: bytes) -> Settings:
    """Returns the settings that stand in a log; those that it does not name have their defaults.

    Raises:
        ValueError: It is not JSON, or names what is no setting, or a value does not fit.
    """
    values: Any = json.loads(data)
    if not isinstance(values, dict):
        raise TypeError(f"expected an object, got {type(values).__name__}")
    defaults = dataclasses.asdict(Settings())
    for name, value in values.items():
        if name not in defaults:
            raise ValueError(f"there is no setting {name!r}")
        if type(value) not in (int, type(defaults[name])):
            raise TypeError(f"{name} must be a number such as {defaults[name]}, got {value!r}")
    return Settings(**values)


def with_digest(name: str, texts: Mapping[str, str]) -> dict[str, str]:
    """Returns a record with a digest of itself: MCAP has no checksum for one record alone."""
    return {**texts, DIGEST: _digest(name, texts)}


def without_digest(name: str, texts: Mapping[str, str]) -> dict[str, str]:
    """Returns a record of ours as it was before its digest was added.

    Raises:
        ValueError: The digest is missing, or is not that of the record.
    """
    bare = {key: text for key, text in texts.items() if key != DIGEST}
    if texts.get(DIGEST) != _digest(name, bare):
        raise ValueError(f"the record {name} does not have the digest that it says")
    return bare


def _digest(name: str, texts: Mapping[str, str]) -> str:
    return sha256(json.dumps([name, sorted(texts.items())]).encode())


def sha256(data: bytes) -> str:
    """Returns the SHA-256 of ``data``, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def checked_name(name: str) -> str:
    """Returns ``name`` if it can name a trial and its file.

    Raises:
        InputError: It has other characters than letters, digits and ``-``.
    """
    if not _NAME.fullmatch(name):
        raise InputError(
            f"a trial's name names its file: expected 1 to 100 letters, digits and '-', "
            f"got {name!r}"
        )
    return name
