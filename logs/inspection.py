"""Summary and verification of a log, without simulation."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from selfmodel.arrays import finite_or_none
from selfmodel.files import file_digest
from selfmodel.logs.errors import GOOD, CorruptError, SchemaMismatchError
from selfmodel.logs.log_file import Messages, read_contents
from selfmodel.logs.reader import TrialLog, interpret, read_log
from selfmodel.logs.records import HIDDEN, IMPORT, SALVAGE
from selfmodel.robot.mjcf.untrusted import checked_model


def read_info(path: Path) -> dict[str, Any]:
    """Returns the summary of a log as JSON values, without the hidden faults of a simulated robot.

    ``observed`` has the fraction of observed numbers by signal, in [0, 1], ``attachments`` sizes in
    bytes, and ``source`` the origin of an imported or salvaged trial.

    Raises:
        LogError: The file is damaged, or not a trial log.
        InputError: The file does not exist.
    """
    contents = read_contents(path)
    log = interpret(contents)
    trial, timing, signals = log.trial, log.timing, log.trial.trajectory.signals
    clock = {"late": timing.late, "missing": timing.missing} if timing else {}
    return {
        "file": str(path),
        "bytes": path.stat().st_size,
        "robot": trial.robot,
        "trial": trial.plan.name,
        "stage": trial.plan.stage,
        "status": log.status,
        "reason": log.reason,
        "steps": trial.trajectory.steps,
        "planned_steps": trial.plan.steps,
        "control_timestep": log.control_timestep,
        "seed": trial.plan.seed,
        "displacement": finite_or_none(trial.displacement),
        "driver": trial.plan.controller.summary,
        "software": dict(log.software),
        "topics": {
            name: {"type": held.type, "messages": len(held.times), "rate": round(_rate(held), 3)}
            for name, held in contents.topics.items()
        },
        "attachments": {name: len(data) for name, data in contents.attachments.items()},
        "records": list(contents.metadata),
        "observed": {
            signal: round(float(np.mean(~np.isnan(values))), 6) if values.size else 1.0
            for signal, values in signals.items()
        },
        "clock": {name: int(flags.sum()) for name, flags in clock.items()} or None,
        "truth": "hidden" if HIDDEN in contents.metadata else "unknown",
        "source": dict(contents.metadata.get(SALVAGE) or contents.metadata.get(IMPORT) or {}),
        "digest": file_digest(path),
    }


def _rate(messages: Messages) -> float:
    """Mean rate of the messages on a topic, 1/s; 0 for a single one."""
    times = [time for time, _ in messages.times]
    span = (times[-1] - times[0]) * 1e-9 if len(times) > 1 else 0.0
    return (len(times) - 1) / span if span else 0.0


@dataclass(frozen=True, eq=False)
class Verified:
    """Content of a verified log, whether MuJoCo has loaded its model, and the file's SHA-256."""

    log: TrialLog
    model_loaded: bool
    digest: str


def verify(path: Path, expected: str = "") -> Verified:
    """Verifies a log.

    Verified are the checks of ``read_log``; the expected SHA-256, if one is given; that the model
    names no other files; and, if MuJoCo is
    installed, that the model loads and is of the robot of the messages.

    Raises:
        LogError: A check failed.
        InputError: The file does not exist.
    """
    log, digest = read_log(path), file_digest(path)
    if expected not in ("", digest):
        what = f"expected the file with the SHA-256 {expected}, this one has {digest}"
        raise CorruptError(path, what, advice="get the expected log from its origin again")
    try:
        checked_model(log.mjcf, log.assets)
    except ValueError as error:
        raise SchemaMismatchError(path, str(error), good=GOOD) from error
    try:
        from selfmodel.logs.robots import robot_of  # noqa: PLC0415  # it needs MuJoCo
    except ImportError:
        return Verified(log, model_loaded=False, digest=digest)
    robot_of(log)
    return Verified(log, model_loaded=True, digest=digest)
