"""Drawing of a logged trial and its simulation into a file."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.progress import track

from selfmodel.cli.output.console import text_console
from selfmodel.cli.output.plain import counted, plain
from selfmodel.cli.output.printing import print_notes
from selfmodel.cli.rendering import camera, video
from selfmodel.cli.rendering.film import Film, evenly, film_of
from selfmodel.cli.rendering.filmstrip import stick_frames, strip
from selfmodel.cli.replayed_log import replayed_log
from selfmodel.errors import InputError, WorkError
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.logs import TrialLog
from selfmodel.logs.errors import LogWriteError
from selfmodel.logs.files import replace_file
from selfmodel.robot.robot import Robot
from selfmodel.robot.state import POSE
from selfmodel.simulation.simulator import Simulator
from selfmodel.simulation.threads import thread_count
from selfmodel.simulation.trial_replay import replay
from selfmodel.trials.trial import check_magnitudes


def draw_trial(
    file: Path,
    out: Path,
    *,
    hypothesis: str,
    kinds: str,
    model: str | None,
    pictures: int | None,
    sticks: bool,
    threads: int,
) -> dict[str, Any]:
    """Draws a logged trial beside its simulation; returns the facts of the drawing as JSON values.

    Args:
        file: Log of the trial.
        out: File to write.
        hypothesis: Notation of the hypothesis to simulate.
        kinds: Fault kinds that the notation may name, as in ``--kinds``.
        model: Self-model to use instead of the log's, as in ``--robot``.
        pictures: Pictures of a strip; None for a film.
        sticks: Draws with matplotlib instead of MuJoCo.
        threads: Threads of the physics; 0 for one per processor.

    Raises:
        InputError: The log, the hypothesis or the model cannot be used.
        WorkError: The file could not be written.
    """
    given = replayed_log(file, hypothesis, kinds=kinds, model=model)
    robot = given.robot
    film, facts = _filmed(given.log, robot, given.hypothesis, pictures, thread_count(threads))
    print_notes(*(f"note: {note}" for note in facts["notes"]))
    data = _drawn(film, out.suffix.lower().removeprefix("."), pictures, sticks=sticks)
    try:
        replace_file(out, data)
    except LogWriteError as error:
        raise WorkError(f"{out}: it could not be written: {error.reason}") from error
    return {
        "log": str(file),
        "robot": robot.name,
        "model": model,
        **facts,
        "out": str(out),
        "frames": len(film.time),
        "bytes": len(data),
    }


def _filmed(
    log: TrialLog, robot: Robot, assumed: Hypothesis, pictures: int | None, threads: int
) -> tuple[Film, dict[str, Any]]:
    """Returns the film of a trial and its simulation, and the facts of the simulation."""
    logged = log.trial.behaviour
    check_magnitudes(log.trial, POSE)
    if pictures is None and not logged.time[-1] * video.RATE < video.MAX_FRAMES:
        raise InputError(
            f"{log.trial.path}: the trial takes {logged.time[-1]:g} s, and a film takes at most "
            f"{video.MAX_FRAMES / video.RATE:g} s: write a strip of pictures, such as trial.png"
        )
    found = replay(log.trial, assumed, Simulator(robot, threads))
    whole = np.arange(int(float(logged.time[-1]) * video.RATE) + 1) / video.RATE
    moments = whole if pictures is None else evenly(logged.time, pictures)
    film = film_of(
        robot,
        assumed,
        [
            (plain(f"logged: {log.trial.plan.name}"), logged),
            (plain(f"model: {assumed}"), found.simulated),
        ],
        moments,
    )
    held = int(film.shots[0].held.sum())
    notes = []
    if film.missing:
        notes.append(
            f"{log.trial.path} has no {', '.join(film.missing)}: drawn as in the initial pose"
        )
    if held:
        notes.append(
            f"{held} of {counted(len(film.time), 'picture')} lack an observation: the last one "
            f"is drawn, and marked"
        )
    if found.diverged:
        notes.append("the simulation diverged: with this hypothesis the model is unstable")
    return film, {
        "hypothesis": str(assumed),
        "steps": logged.steps,
        "missing": list(film.missing),
        "held": held,
        "diverged": found.diverged,
        "notes": notes,
    }


def _drawn(film: Film, kind: str, pictures: int | None, *, sticks: bool) -> bytes:
    """Returns the bytes of a file of that kind."""
    if pictures is not None:
        return strip(film, kind)
    frames = stick_frames(film) if sticks else camera.filmed(film)
    encode = video.gif if kind == "gif" else video.mp4
    return encode(_shown(frames, len(film.time)))


def _shown(frames: Iterable[NDArray[np.uint8]], total: int) -> Iterator[NDArray[np.uint8]]:
    """Yields the frames; shows a progress bar on a terminal."""
    console = text_console(stderr=True)
    yield from track(
        frames, "drawing", total, console=console, disable=not console.is_terminal, transient=True
    )
