"""``selfmodel view``: a logged trial and its simulation in Rerun, and the log in Foxglove."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from selfmodel.cli.arguments.inputs import check_folder
from selfmodel.cli.arguments.options import (
    HypothesisText,
    Json,
    LogFile,
    NamedKinds,
    SelfModel,
    Threads,
)
from selfmodel.cli.output.printing import print_json, print_lines, print_notes
from selfmodel.cli.rendering.film import film_of
from selfmodel.cli.replayed_log import ReplayedLog, replayed_log
from selfmodel.cli.viewing.foxglove import foxglove_lines, layout_path
from selfmodel.cli.viewing.recording import LOGGED, SIMULATED, fill_recording
from selfmodel.cli.viewing.rerun_view import (
    PORT,
    check_display,
    import_rerun,
    open_viewer,
    write_recording,
)
from selfmodel.errors import InputError
from selfmodel.logs.files import refuse_existing
from selfmodel.robot.state import POSE
from selfmodel.simulation.simulator import Simulator
from selfmodel.simulation.threads import thread_count
from selfmodel.simulation.trial_replay import Replay, replay
from selfmodel.trials.trial import check_magnitudes


def view(
    file: LogFile,
    *,
    hypothesis: HypothesisText = "intact",
    kinds: NamedKinds = "all",
    model: SelfModel = None,
    out: Annotated[
        Path | None,
        typer.Option(
            *("--out", "-o"),
            metavar="NEW.rrd",
            help="File of Rerun to write, instead of opening its viewer.",
        ),
    ] = None,
    port: Annotated[
        int,
        typer.Option(
            min=1,
            max=65535,
            metavar="N",
            help="Port of Rerun's viewer on this computer; a viewer that has it is used.",
        ),
    ] = PORT,
    threads: Threads = 0,
    as_json: Json = False,
) -> None:
    """Open a logged trial in Rerun: the body as logged, and as simulated under a hypothesis.

    Beside the bodies are the joint positions of both, and the errors over time. The command also
    prints how to open the same log in Foxglove.
    """
    if out is not None:
        _check_name(out)
    else:
        check_display()
    import_rerun()  # a missing package is an error before any work is done
    given = replayed_log(file, hypothesis, kinds=kinds, model=model)
    log, robot, assumed = given.log, given.robot, given.hypothesis
    check_magnitudes(log.trial, POSE)
    found = replay(log.trial, assumed, Simulator(robot, thread_count(threads)))
    if found.diverged:
        print_notes("note: the simulation diverged: with this hypothesis the model is unstable")
    written = _show(given, found, out, port)
    if as_json:
        print_json(
            {
                "log": str(file),
                "robot": robot.name,
                "hypothesis": str(assumed),
                "steps": log.trial.behaviour.steps,
                "diverged": found.diverged,
                "out": str(out) if out else None,
                "bytes": written,
                "foxglove_layout": str(layout_path()),
            }
        )
        return
    body = f"{robot.name} as logged, and simulated as {assumed}, transparent"
    if out is None:
        print_lines(f"Rerun shows {body}.")
    else:
        print_lines(f"{out}: {body}; open it with `rerun {out}`.")
    print_lines(*foxglove_lines(str(file)))


def _check_name(out: Path) -> None:
    if out.suffix.lower() != ".rrd":
        raise InputError(f"--out needs a name that ends in .rrd, got {str(out)!r}")
    check_folder(out)
    refuse_existing(out)


def _show(given: ReplayedLog, found: Replay, out: Path | None, port: int) -> int | None:
    """Opens the viewer, or writes the file; returns the number of bytes of the file."""
    log, robot, assumed = given.log, given.robot, given.hypothesis
    logged = log.trial.behaviour
    motions = [(LOGGED, logged), (SIMULATED, found.simulated)]
    film = film_of(robot, assumed, motions, np.asarray(logged.time))
    about = (
        f"**{robot.name}**, trial {log.trial.plan.name}\n\n"
        f"- solid: as logged\n"
        f"- transparent: simulated as `{assumed}` with the logged controller\n"
        f"- grey: detached by the hypothesis; red: jammed by it\n"
    )
    if out is None:
        open_viewer(lambda recording: fill_recording(recording, film, logged, found, about), port)
        return None
    return write_recording(
        out, lambda recording: fill_recording(recording, film, logged, found, about)
    )
