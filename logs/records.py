"""Metadata records and attachments of a trial log."""

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
from selfmodel.trials.trial import STAGES, Stage, checked_seed, stage_of

FORMAT = "1"
"""Version of the format of a log; a reader refuses unknown versions."""

TIMED_FORMAT = "2"
"""Version of the format of a robot with its own clock: the same with ``/timing``."""

FORMATS = (FORMAT, TIMED_FORMAT)

TRIAL = "selfmodel.trial"
SOFTWARE = "selfmodel.software"
HIDDEN = "selfmodel.hidden"
"""Hidden faults and reality gap of a simulated physical robot, which a diagnosis never reads."""
IMPORT = "selfmodel.import"
"""Origin of an imported trial, and the quality of the recording."""
SALVAGE = "selfmodel.salvage"
"""Origin of a salvaged trial."""
RESULT = "selfmodel.result"

SEALS, SEAL_TYPE = "/provenance", "selfmodel_msgs/msg/Seal"
"""Topic of the digests of its batches in a log that version 0.1 wrote; it is not read."""

OWN = "selfmodel."
"""Prefix of the names of selfmodel's records; each contains a digest of itself."""
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
"""Media types by attachment; other attachments are ``application/octet-stream``."""

TRUTH = "truth"
GAP = "gap"
FINISHED = "finished"
INTERRUPTED = "interrupted"
STOPPED = "stopped"

MIN_CONTROL_TIMESTEP, MAX_CONTROL_TIMESTEP = 1e-9, 3600.0
"""Bounds of the control time step, s: the time stamps of a log are in nanoseconds, and bounded."""

MAX_TEXT = 1000
"""Maximum length of a text in a record, characters."""

_NAME = re.compile(r"[A-Za-z0-9-]{1,100}")


@dataclass(frozen=True)
class TrialRecord:
    """Record ``selfmodel.trial``, written before the trial starts.

    Attributes:
        format: Version of the log's format.
        name: Name of the trial within its run.
        stage: Stage of the recovery.
        robot: Name of the robot.
        root: Name of the root body, whose motion is on ``/odom``.
        control_timestep: Control time step, s; step k is at k times this value.
        steps: Planned number of control steps.
        seed: Seed of all random choices, from 0 to ``trial.MAX_SEED``.
        controller_sha256: SHA-256 of the attached controller, or "" without one: then only the
            commands are known.
        model_sha256: SHA-256 of the attached model.
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
        """Returns the record as texts, the form of MCAP metadata."""
        return {
            name: value if isinstance(value, str) else repr(value)
            for name, value in dataclasses.asdict(self).items()
        }


@dataclass(frozen=True)
class Result:
    """Record ``selfmodel.result``, written last.

    Attributes:
        status: ``finished``, ``interrupted`` or ``stopped``.
        steps: Number of logged control steps.
        displacement: Forward displacement of the base, m.
        reason: Cause of the stop, or "".
    """

    status: str
    steps: int
    displacement: float
    reason: str = ""

    def texts(self) -> dict[str, str]:
        """Returns the record as texts, the form of MCAP metadata."""
        return {
            "status": self.status,
            "steps": str(self.steps),
            "displacement": repr(self.displacement),
            **({"reason": self.reason[:MAX_TEXT]} if self.reason else {}),
        }


@dataclass(frozen=True)
class Imported:
    """Origin of an imported trial.

    Attributes:
        facts: Source and quality of the recording, as texts by name.
        mapping: Mapping from the recording's topics to signals, as TOML.
    """

    facts: Mapping[str, str]
    mapping: str


@dataclass(frozen=True)
class TrialHeader:
    """Content of a log's preamble except the robot and the plan.

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
    """Returns the trial record of a log.

    Raises:
        ValueError: A field is missing or invalid; the message names the field.
    """
    fields = [field.name for field in dataclasses.fields(TrialRecord)]
    missing = [name for name in fields if name not in texts]
    if missing:
        raise ValueError(f"it lacks {', '.join(missing)}")
    stage = stage_of(texts["stage"])
    if stage is None:
        raise ValueError(f"stage must be one of {', '.join(STAGES)}, got {texts['stage']!r}")
    long = [name for name in fields if len(texts.get(name, "")) > MAX_TEXT]
    if long:
        raise ValueError(f"expected at most {MAX_TEXT} characters in {', '.join(long)}")
    timestep = float(texts["control_timestep"])
    if not MIN_CONTROL_TIMESTEP <= timestep <= MAX_CONTROL_TIMESTEP:
        raise ValueError(
            f"control_timestep must be above 0 s, from {MIN_CONTROL_TIMESTEP} to "
            f"{MAX_CONTROL_TIMESTEP}, got {texts['control_timestep']!r}"
        )
    return TrialRecord(
        format=texts["format"],
        name=texts["name"],
        stage=stage,
        robot=texts["robot"],
        root=texts["root"],
        control_timestep=timestep,
        steps=int(texts["steps"]),
        seed=checked_seed(int(texts["seed"])),
        controller_sha256=texts["controller_sha256"],
        model_sha256=texts["model_sha256"],
    )


def result_record(texts: Mapping[str, str]) -> Result:
    """Returns the result record of a log.

    Raises:
        ValueError: A field is missing or invalid.
    """
    missing = [name for name in ("status", "steps", "displacement") if name not in texts]
    if missing:
        raise ValueError(f"it lacks {', '.join(missing)}")
    reason = texts.get("reason", "")
    if len(reason) > MAX_TEXT:
        raise ValueError(f"expected at most {MAX_TEXT} characters in reason")
    return Result(texts["status"], int(texts["steps"]), float(texts["displacement"]), reason)


def settings_json(settings: Settings) -> bytes:
    """Returns settings as JSON."""
    return json.dumps(dataclasses.asdict(settings), indent=1).encode()


def parse_settings(data: bytes) -> Settings:
    """Returns the settings of a log; a missing setting has its default.

    Raises:
        ValueError: The data are not JSON, or a name or a value is invalid.
        TypeError: The data are no JSON object, or a value is no number.
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
    """Returns a record with its digest: MCAP has no checksum of a single record."""
    return {**texts, DIGEST: _digest(name, texts)}


def without_digest(name: str, texts: Mapping[str, str]) -> dict[str, str]:
    """Returns a record of selfmodel without its verified digest.

    Raises:
        ValueError: The digest is missing or wrong.
    """
    bare = {key: text for key, text in texts.items() if key != DIGEST}
    if texts.get(DIGEST) != _digest(name, bare):
        raise ValueError(f"the digest of the record {name} is missing or wrong")
    return bare


def _digest(name: str, texts: Mapping[str, str]) -> str:
    return sha256(json.dumps([name, sorted(texts.items())]).encode())


def sha256(data: bytes) -> str:
    """Returns the SHA-256 of ``data``, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def checked_name(name: str) -> str:
    """Returns ``name`` if it is a valid name of a trial and its file.

    Raises:
        InputError: The name has other characters than letters, digits and ``-``.
    """
    if not _NAME.fullmatch(name):
        raise InputError(
            f"a trial's name names its file: expected 1 to 100 letters, digits and '-', "
            f"got {name!r}"
        )
    return name
