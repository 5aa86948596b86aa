"""Metadata records and attachments of a trial log."""

import dataclasses
import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, TypeVar

import msgspec
from msgspec import Meta, Struct

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.settings import Settings
from selfmodel.trials.trial import MAX_SEED, Stage

FORMAT, TIMED_FORMAT = "1", "2"
"""Versions of the format of a log; that of a robot with its own clock is the same with ``/timing``.
"""

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

MODEL_FILE, CONTROLLER_FILE = "model.xml", "controller.npz"
SETTINGS_FILE, MAPPING_FILE = "settings.json", "mapping.toml"
OWN_FILES = (MODEL_FILE, CONTROLLER_FILE, SETTINGS_FILE, MAPPING_FILE)
"""Attachments of selfmodel; all others are files that the model may name."""

MEDIA_TYPES: Mapping[str, str] = {
    MODEL_FILE: "application/xml",
    SETTINGS_FILE: "application/json",
    MAPPING_FILE: "application/toml",
}
"""Media types by attachment; other attachments are ``application/octet-stream``."""

TRUTH, GAP = "truth", "gap"
"""Keys of ``HIDDEN``."""

STATUSES = FINISHED, INTERRUPTED, STOPPED = "finished", "interrupted", "stopped"

MAX_START = 2 * 10**18
"""Latest time stamp of the first step of an imported trial, ns: those of ROS end in 2038."""

MAX_TEXT = 1000
"""Maximum length of a text in a record, characters."""

Text = Annotated[str, Meta(max_length=MAX_TEXT)]


class TrialRecord(Struct, frozen=True, omit_defaults=True):
    """Record ``selfmodel.trial``, written before the trial starts.

    Attributes:
        format: Version of the log's format.
        name: Name of the trial within its run.
        root: Name of the root body, whose motion is on ``/odom``.
        control_timestep: Control time step, s; step k is at k times this value. Time stamps are in
            nanoseconds, and bounded.
        steps: Planned number of control steps.
        seed: Seed of all random choices.
        controller_sha256: SHA-256 of the attached controller, or "" without one: then only the
            commands are known.
        model_sha256: SHA-256 of the attached model.
        motors: Names of the motors, as JSON, if ``/joint_commands`` has the names of the joints
            that they drive; "" if it has theirs.
        function: Name of the function of Python that controlled the robot; "" if none did.
    """

    format: Text
    name: Text
    stage: Stage
    robot: Text
    root: Text
    control_timestep: Annotated[float, Meta(ge=1e-9, le=3600.0)]
    steps: int
    seed: Annotated[int, Meta(ge=0, le=MAX_SEED)]
    controller_sha256: Text
    model_sha256: Text
    motors: str = ""
    function: Text = ""


class ResultRecord(Struct, frozen=True, omit_defaults=True):
    """Record ``selfmodel.result``, written last.

    Attributes:
        status: One of ``STATUSES``.
        steps: Number of logged control steps.
        displacement: Forward displacement of the base, m.
        reason: Cause of the stop, or "".
    """

    status: str
    steps: int
    displacement: float
    reason: Text = ""


Record = TypeVar("Record", TrialRecord, ResultRecord)


def texts_of(record: Struct) -> dict[str, str]:
    """Returns a record as texts, the form of MCAP metadata."""
    return {
        name: value if isinstance(value, str) else repr(value)
        for name, value in msgspec.to_builtins(record).items()
    }


def record_of(kind: type[Record], texts: Mapping[str, str]) -> Record:
    """Returns the record in texts; the inverse of ``texts_of``."""
    return msgspec.convert(texts, kind, strict=False)


@dataclass(frozen=True, eq=False)
class Imported:
    """Origin of an imported trial, and what no signal has.

    Attributes:
        facts: Source and quality by name; ``start`` is the recorded time of the first step, ns.
        mapping: The mapping, as TOML.
        acceleration: Acceleration of the base, see ``messages.Part``; None without an IMU.
    """

    facts: Mapping[str, str]
    mapping: str
    acceleration: FloatArray | None = None

    @property
    def start(self) -> int:
        """Time stamp of the first step, ns: that of the recording, or 0 if ROS has no such time."""
        start = int(self.facts["start"])
        return start if 0 <= start < MAX_START else 0


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


def parse_settings(data: bytes) -> Settings:
    """Returns the settings of a log; a missing setting has its default."""
    values = msgspec.json.decode(data, type=dict[str, float | int | str | None])
    if unknown := values.keys() - {field.name for field in dataclasses.fields(Settings)}:
        raise ValueError(f"there is no setting {min(unknown)!r}")
    return msgspec.convert(values, Settings)


def with_digest(name: str, texts: Mapping[str, str]) -> dict[str, str]:
    """Returns a record with its digest: MCAP has no checksum of a single record."""
    return {**texts, DIGEST: sha256(json.dumps([name, sorted(texts.items())]).encode())}


def without_digest(name: str, texts: Mapping[str, str]) -> dict[str, str]:
    """Returns a record of selfmodel without its verified digest."""
    bare = {key: text for key, text in texts.items() if key != DIGEST}
    if texts != with_digest(name, bare):
        raise ValueError(f"the digest of the record {name} is missing or wrong")
    return bare


def sha256(data: bytes) -> str:
    """Returns the SHA-256 of ``data``, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def checked_name(name: str) -> str:
    """Returns ``name`` if it is a valid name of a trial and its file."""
    if not re.fullmatch(r"[A-Za-z0-9-]{1,100}", name):
        raise InputError(
            f"a trial's name names its file: expected 1 to 100 letters, digits and '-', "
            f"got {name!r}"
        )
    return name
