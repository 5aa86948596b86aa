"""``selfmodel logs import``: a recording of a robot, a bag or a table, as a trial log."""

from pathlib import Path
from typing import Annotated, Any

import typer

from selfmodel import arguments
from selfmodel.arguments import is_model
from selfmodel.cli.arguments.inputs import check_log_name
from selfmodel.cli.arguments.options import Json
from selfmodel.cli.output.plain import counted
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.cli.output.tables import show
from selfmodel.controllers.controller import Controller
from selfmodel.errors import InputError
from selfmodel.logs.files import refuse_existing
from selfmodel.logs.recordings.importer import ImportedTrial, import_recording, write_recording
from selfmodel.logs.recordings.mapping_file import RecordingMapping, read_mapping
from selfmodel.logs.recordings.suggest import suggest as suggest_mapping
from selfmodel.robot.robot import Robot


def import_(
    recording: Annotated[
        Path,
        typer.Argument(
            metavar="RECORDING",
            help="A bag of ROS (folder, .mcap, .db3, .bag) or a table (.csv, .npz, .parquet).",
        ),
    ],
    *,
    out: Annotated[
        Path | None,
        typer.Option(*("--out", "-o"), metavar="NEW.mcap", help="Log to write; it must not exist."),
    ] = None,
    mapping: Annotated[
        Path | None,
        typer.Option(metavar="MAP.toml", help="Topics or columns per signal and joint."),
    ] = None,
    suggest: Annotated[
        bool, typer.Option("--suggest", help="Print a mapping to edit, and import nothing.")
    ] = False,
    robot: Annotated[
        str | None,
        typer.Option(
            metavar="ROBOT", help="Robot of --suggest: a robot's name, or its MJCF or URDF."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Import a recording of a robot as a trial log: a bag of ROS, without ROS, or a table."""
    if suggest:
        if robot is None or out or mapping or as_json:
            raise InputError(
                "--suggest needs --robot ROBOT, and excludes --out, --mapping and --json"
            )
        lines = _suggestion(recording, robot).removesuffix("\n").split("\n")
        print_lines(*lines)
        return
    if robot is not None:
        raise InputError("--robot is for --suggest: the robot of an import is in its mapping")
    if out is None or mapping is None:
        raise InputError(
            "an import needs --out TRIAL.mcap and --mapping MAP.toml; "
            "--suggest --robot ROBOT prints a mapping to edit"
        )
    check_log_name(out)
    _import(recording, out, mapping, as_json=as_json)


def _suggestion(recording: Path, name: str) -> str:
    made = arguments.recorded_robot(name, None)
    return suggest_mapping(recording, made, name, with_timestep=is_model(name))


def _import(source: Path, out: Path, path: Path, *, as_json: bool) -> None:
    refuse_existing(out)
    mapping = read_mapping(path)
    made = _mapped_robot(mapping, path.parent)
    controller = _controller(mapping, path.parent, made)
    recording = import_recording(source, mapping, made)
    write_recording(out, made, recording, mapping, controller)
    if as_json:
        print_json(_facts(out, mapping, recording))
    else:
        _print(out, recording)


def _mapped_robot(mapping: RecordingMapping, folder: Path) -> Robot:
    """Returns the robot of a mapping: one of selfmodel's, or of a model file beside the mapping."""
    name, timestep = mapping.trial.robot, mapping.trial.control_timestep
    own = not is_model(name)
    if own and timestep is not None:
        raise mapping.error(
            ("control_timestep",), f"{name} has a control time step of its own: remove this entry"
        )
    if not own and timestep is None:
        raise mapping.error(("robot",), f"{name} has no control time step: add control_timestep, s")
    try:
        return arguments.recorded_robot(name if own else str(folder / name), timestep)
    except InputError as error:
        raise mapping.error(("robot",), str(error)) from error


def _controller(mapping: RecordingMapping, folder: Path, robot: Robot) -> Controller | None:
    if mapping.trial.controller is None:
        return None
    try:
        return arguments.read_controller(folder / mapping.trial.controller, robot)
    except InputError as error:
        raise mapping.error(("controller",), str(error)) from error


def _facts(out: Path, mapping: RecordingMapping, recording: ImportedTrial) -> dict[str, Any]:
    return {
        "log": str(out),
        "robot": mapping.trial.robot,
        "steps": recording.behaviour.steps,
        "valid": recording.valid,
        "topics": {topic: found.facts() for topic, found in recording.qualities.items()},
        "clock": recording.clock,
        "notes": list(recording.notes),
    }


def _print(out: Path, recording: ImportedTrial) -> None:
    rows = [
        (
            topic,
            str(found.messages),
            _number(found.rate),
            _number(found.jitter, 1e3),
            str(len(found.gaps)),
            _number(found.longest, 1e3),
            _number(found.latency, 1e3),
        )
        for topic, found in recording.qualities.items()
    ]
    show(("topic", "msgs", "Hz", "jitter, ms", "gaps", "longest, ms", "late, ms"), rows)
    valid = ", ".join(f"{signal} {share:.0%}" for signal, share in recording.valid.items())
    print_lines(
        *(f"note: {note}" for note in recording.notes),
        f"observed: {valid}",
        f"{counted(recording.behaviour.steps, 'step')}: {out}",
    )


def _number(value: float | None, scale: float = 1.0) -> str:
    return "-" if value is None else f"{value * scale:.1f}"
