"""``selfmodel render``: a trial as a film or a strip of pictures, from its log."""

from pathlib import Path
from typing import Annotated, Any

import typer

from selfmodel.cli.arguments.inputs import check_folder
from selfmodel.cli.arguments.options import (
    Json,
    LogFile,
    NamedKinds,
    SelfModel,
    Threads,
)
from selfmodel.cli.output.plain import counted
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.cli.rendering import gl, video
from selfmodel.cli.rendering.diagnosed import diagnosed
from selfmodel.errors import InputError
from selfmodel.logs.files import refuse_existing

STRIPS = (".png", ".svg", ".pdf")
"""File extensions of a strip of pictures."""

FILMS = (".gif", ".mp4")
"""File extensions of a film."""


def render(
    file: LogFile,
    *,
    out: Annotated[
        Path | None,
        typer.Option(
            *("--out", "-o"),
            metavar="PICTURE",
            help="Film (.gif, .mp4) or strip of stick figures (.png, .svg, .pdf) to write.",
            show_default="beside the log, .gif",
        ),
    ] = None,
    hypothesis: Annotated[
        str | None,
        typer.Option(
            metavar="NOTATION",
            help="Hypothesis to simulate, such as break:front_left_knee.",
            show_default="intact",
        ),
    ] = None,
    diagnosis: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.json",
            help="Simulate the best hypothesis of a diagnosis: the result.json of a recovery, or "
            "the output of `selfmodel diagnose --json`.",
        ),
    ] = None,
    kinds: NamedKinds = "all",
    model: SelfModel = None,
    stick: Annotated[
        bool,
        typer.Option("--stick", help="Draw the film with stick figures, which needs no OpenGL."),
    ] = False,
    pictures: Annotated[
        int, typer.Option(min=2, max=50, metavar="N", help="Pictures of a strip.")
    ] = 6,
    threads: Threads = 0,
    as_json: Json = False,
) -> None:
    """Draw a logged trial beside a simulation of the same controller.

    The logged motion is on the left or above, the simulation of the hypothesis beside or below
    it. In both, a limb that the hypothesis detaches is pale and a jammed part is red.
    """
    if not file.name:
        raise InputError(f"expected a trial log, NAME.mcap, got the folder {file}")
    out = file.with_suffix(".gif") if out is None else out
    _check_name(out, stick=stick)
    if hypothesis is not None and diagnosis is not None:
        raise InputError("expected --hypothesis or --diagnosis, got both: leave one out")
    library = _choose_gl(out, stick=stick)
    # MuJoCo reads MUJOCO_GL as it is imported, so the library is chosen before.
    from selfmodel.cli.rendering.drawing import draw_trial  # noqa: PLC0415  # see above

    if diagnosis is not None:
        hypothesis = diagnosed(diagnosis)
    result = draw_trial(
        file,
        out,
        hypothesis=hypothesis or "intact",
        kinds=kinds,
        model=model,
        pictures=None if out.suffix.lower() in FILMS else pictures,
        sticks=library is None,
        threads=threads,
    )
    result |= {"drawn_by": "matplotlib" if library is None else "mujoco", "gl": library}
    if as_json:
        print_json(result)
    else:
        _print(result)


def _check_name(out: Path, *, stick: bool) -> None:
    kind = out.suffix.lower()
    if kind not in (*FILMS, *STRIPS):
        raise InputError(
            f"--out needs a name that ends in {', '.join((*FILMS, *STRIPS))}, got {str(out)!r}"
        )
    check_folder(out)
    if stick and kind in STRIPS:
        raise InputError(f"--stick is for films: a strip such as {out.name} has stick figures")
    refuse_existing(out)


def _choose_gl(out: Path, *, stick: bool) -> str | None:
    """Returns MuJoCo's OpenGL library; None if matplotlib draws."""
    if out.suffix.lower() == ".mp4":
        video.ffmpeg()  # a missing program is an error before any work is done
    if stick or out.suffix.lower() in STRIPS:
        gl.choose_nothing()
        return None
    return gl.choose_gl()


def _print(result: dict[str, Any]) -> None:
    print_lines(
        f"{result['out']}: {counted(result['frames'], 'picture')} of {result['robot']}, as "
        f"logged and as {result['hypothesis']}, drawn by {result['drawn_by']}"
        + (f" ({result['gl']})" if result["gl"] else "")
    )
