"""``selfmodel render``: a trial as a film or a strip of pictures, from its log."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selfmodel.cli.options import Json, NamedKinds, RobotOrModel, Threads
from selfmodel.errors import InputError, WorkError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import numpy as np
    from numpy.typing import NDArray

    from selfmodel.cli.rendering.film import Film
    from selfmodel.faults.hypothesis import Hypothesis
    from selfmodel.logs import TrialLog
    from selfmodel.robot.robot import Robot

STRIPS = (".png", ".svg", ".pdf")
"""Endings of a strip of pictures."""

FILMS = (".gif", ".mp4")
"""Endings of a film."""


def render(
    file: Annotated[Path, typer.Argument(metavar="LOG", help="A trial log, NAME.mcap.")],
    *,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE.gif|mp4|png|svg|pdf",
            help="A film (.gif, .mp4) or a strip of stick figures (.png, .svg, .pdf).",
            show_default="beside the log, .gif",
        ),
    ] = None,
    hypothesis: Annotated[
        str | None,
        typer.Option(
            metavar="NOTATION",
            help="What is taken to be wrong, such as break:front_left_knee.",
            show_default="intact",
        ),
    ] = None,
    diagnosis: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.json",
            help="Take the best hypothesis of a diagnosis: the result.json of a recovery, or what "
            "`selfmodel diagnose --json` printed.",
        ),
    ] = None,
    kinds: NamedKinds = "all",
    model: RobotOrModel = None,
    stick: Annotated[
        bool,
        typer.Option("--stick", help="Draw the film with stick figures, which needs no OpenGL."),
    ] = False,
    pictures: Annotated[
        int, typer.Option(min=2, max=50, help="How many pictures a strip has.")
    ] = 6,
    threads: Threads = 0,
    as_json: Json = False,
) -> None:
    """Draw a logged trial beside what the robot's model does with what is taken to be wrong.

    On the left, or above, is the motion that was logged; beside it the same controller on the
    model. A limb that is taken to be lost is pale, a part that jammed is red, in both.
    """
    if not file.name:
        raise InputError(f"expected a trial log, NAME.mcap, got the folder {file}")
    out = file.with_suffix(".gif") if out is None else out
    _check_name(out, stick=stick)
    if hypothesis is not None and diagnosis is not None:
        raise InputError("expected --hypothesis or --diagnosis, got both: leave one out")
    gl = _choose_gl(out, stick=stick)
    # Whatever brings MuJoCo waits until it is known what draws.
    from selfmodel.cli.rendering.diagnosed import diagnosed  # noqa: PLC0415
    from selfmodel.experiments import plugins, trial_logs  # noqa: PLC0415
    from selfmodel.faults.notation import parse  # noqa: PLC0415
    from selfmodel.faults.registry import known  # noqa: PLC0415
    from selfmodel.logs.errors import LogWriteError  # noqa: PLC0415
    from selfmodel.logs.files import replace_file  # noqa: PLC0415
    from selfmodel.simulation.threads import thread_count  # noqa: PLC0415

    if diagnosis is not None:
        hypothesis = diagnosed(diagnosis)
    (log,) = trial_logs.logs([file])
    robot = trial_logs.robot_of_logs([log], model)
    film, result = _filmed(
        log,
        robot,
        parse(hypothesis or "intact", robot.anatomy, known(plugins.kinds(kinds))),
        None if out.suffix.lower() in FILMS else pictures,
        thread_count(threads),
    )
    for note in result["notes"]:
        typer.echo(f"note: {note}", err=True)
    data = _drawn(film, out, sticks=gl is None)
    try:
        replace_file(out, data)
    except LogWriteError as error:
        raise WorkError(f"{out}: it could not be written: {error.reason}") from error
    result = {
        "log": str(file),
        "robot": robot.name,
        "model": model,
        **result,
        "out": str(out),
        "drawn_by": "matplotlib" if gl is None else "mujoco",
        "gl": gl,
        "frames": len(film.time),
        "bytes": len(data),
    }
    if as_json:
        typer.echo(json.dumps(result, indent=2, allow_nan=False))
    else:
        _print(result)


def _check_name(out: Path, *, stick: bool) -> None:
    from selfmodel.logs.files import refuse_existing  # noqa: PLC0415  # with the other work

    kind = out.suffix.lower()
    if kind not in (*FILMS, *STRIPS):
        raise InputError(
            f"--out needs a name that ends in {', '.join((*FILMS, *STRIPS))}, got {str(out)!r}"
        )
    if not out.parent.is_dir():
        raise InputError(f"{out}: there is no folder {out.parent}: make it, or choose another")
    if stick and kind in STRIPS:
        raise InputError(
            f"--stick is for films: a strip such as {out.name} is one of stick figures"
        )
    refuse_existing(out)


def _choose_gl(out: Path, *, stick: bool) -> str | None:
    """What MuJoCo is to draw with; None where matplotlib draws."""
    from selfmodel.cli.rendering import gl, video  # noqa: PLC0415  # with the other work

    if out.suffix.lower() == ".mp4":
        video.ffmpeg()  # before any work is done for it
    if stick or out.suffix.lower() in STRIPS:
        gl.choose_nothing()
        return None
    return gl.choose_gl()


def _filmed(
    log: "TrialLog", robot: "Robot", assumed: "Hypothesis", pictures: int | None, threads: int
) -> "tuple[Film, dict[str, Any]]":
    """What is to be drawn, and what there is to say of it."""
    import numpy as np  # noqa: PLC0415  # with the other work

    from selfmodel.cli.rendering.film import evenly, film_of  # noqa: PLC0415
    from selfmodel.cli.rendering.video import RATE  # noqa: PLC0415
    from selfmodel.simulation.replay import replay  # noqa: PLC0415
    from selfmodel.simulation.simulator import Simulator  # noqa: PLC0415

    logged = log.trial.behaviour
    found = replay(log.trial, assumed, Simulator(robot, threads))
    whole = np.arange(int(float(logged.time[-1]) * RATE) + 1) / RATE
    moments = whole if pictures is None else evenly(logged.time, pictures)
    film = film_of(
        robot,
        assumed,
        [(f"logged: {log.trial.plan.name}", logged), (f"model: {assumed}", found.simulated)],
        moments,
    )
    notes = []
    if film.missing:
        notes.append(
            f"{log.trial.path} does not say {', '.join(film.missing)}: drawn as at the start"
        )
    held = int(film.shots[0].held.sum())
    if held:
        notes.append(f"{held} of {len(film.time)} pictures show what was seen last, and say so")
    if found.broke_down:
        notes.append("the simulation broke down: with this hypothesis the model is unstable")
    return film, {
        "hypothesis": str(assumed),
        "steps": logged.steps,
        "missing": list(film.missing),
        "held": held,
        "diverged": found.broke_down,
        "notes": notes,
    }


def _drawn(film: "Film", out: Path, *, sticks: bool) -> bytes:
    """The file's bytes."""
    from selfmodel.cli.rendering import video  # noqa: PLC0415  # with the other work
    from selfmodel.cli.rendering.filmstrip import stick_frames, strip  # noqa: PLC0415  # the same

    kind = out.suffix.lower()
    if kind in STRIPS:
        return strip(film, kind.removeprefix("."))
    if sticks:
        frames = stick_frames(film)
    else:
        from selfmodel.cli.rendering.camera import filmed  # noqa: PLC0415  # brings OpenGL

        frames = filmed(film)
    encode = video.gif if kind == ".gif" else video.mp4
    return encode(_watched(frames, len(film.time)))


def _watched(frames: "Iterable[NDArray[np.uint8]]", total: int) -> "Iterator[NDArray[np.uint8]]":
    """The same frames, with a bar on a terminal."""
    from rich.console import Console  # noqa: PLC0415  # only where frames are drawn
    from rich.progress import track  # noqa: PLC0415  # the same

    console = Console(stderr=True)
    yield from track(
        frames, "drawing", total, console=console, disable=not console.is_terminal, transient=True
    )


def _print(result: dict[str, Any]) -> None:
    from selfmodel.cli.output.plain import plain  # noqa: PLC0415  # only where it is printed

    typer.echo(
        plain(
            f"{result['out']}: {result['frames']} pictures of {result['robot']}, as logged and as "
        )
        + f"{result['hypothesis']}, drawn by {result['drawn_by']}"
        + (f" ({result['gl']})" if result["gl"] else "")
    )
