"""``selfmodel logs import`` and ``export``: recordings and tables, which need a robot."""

from pathlib import Path
from typing import Any

from selfmodel import arguments
from selfmodel.arguments import is_model
from selfmodel.cli.commands import ExportTable, ImportRecording
from selfmodel.cli.inputs import check_log_name
from selfmodel.cli.output import counted, print_json, print_lines
from selfmodel.cli.tables import show
from selfmodel.controllers.controller import Controller
from selfmodel.errors import InputError
from selfmodel.logs.files import refuse_existing
from selfmodel.logs.recordings.importer import ImportedTrial, import_recording, write_recording
from selfmodel.logs.recordings.mapping_file import RecordingMapping, read_mapping
from selfmodel.logs.recordings.suggest import suggest as suggest_mapping
from selfmodel.logs.recordings.tables import export as write_table, writer_of
from selfmodel.robot.robot import Robot


def import_(options: ImportRecording) -> None:
    """Import a recording of a robot as a trial log: a bag of ROS, without ROS, or a table."""
    if options.suggest:
        if options.robot is None or options.out or options.mapping or options.as_json:
            raise InputError(
                "--suggest needs --robot ROBOT, and excludes --out, --mapping and --json"
            )
        lines = _suggestion(options.recording, options.robot).removesuffix("\n").split("\n")
        print_lines(*lines)
        return
    if options.robot is not None:
        raise InputError("--robot is for --suggest: the robot of an import is in its mapping")
    if options.out is None or options.mapping is None:
        raise InputError(
            "an import needs --out TRIAL.mcap and --mapping MAP.toml; "
            "--suggest --robot ROBOT prints a mapping to edit"
        )
    check_log_name(options.out)
    _import(options.recording, options.out, options.mapping, as_json=options.as_json)


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
        print_json(_import_facts(out, mapping, recording))
    else:
        _print_import(out, recording)


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


def _import_facts(out: Path, mapping: RecordingMapping, recording: ImportedTrial) -> dict[str, Any]:
    return {
        "log": str(out),
        "robot": mapping.trial.robot,
        "steps": recording.trajectory.steps,
        "valid": recording.valid,
        "topics": {topic: found.facts() for topic, found in recording.qualities.items()},
        "clock": recording.clock,
        "notes": list(recording.notes),
    }


def _print_import(out: Path, recording: ImportedTrial) -> None:
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
        f"{counted(recording.trajectory.steps, 'step')}: {out}",
    )


def _number(value: float | None, scale: float = 1.0) -> str:
    return "-" if value is None else f"{value * scale:.1f}"


def export(options: ExportTable) -> None:
    """Write the signals of a trial log as a table: one row per control step."""
    writer_of(options.out)
    refuse_existing(options.out)
    (found,) = arguments.read_logs([options.log])
    trajectory = found.trial.trajectory
    names = write_table(options.out, trajectory)
    if options.as_json:
        print_json({"table": str(options.out), "rows": trajectory.steps, "columns": list(names)})
    else:
        print_lines(
            f"{counted(trajectory.steps, 'row')} of {counted(len(names), 'column')}: {options.out}"
        )
