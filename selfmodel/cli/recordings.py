"""``selfmodel logs import`` and ``export``: recordings and tables, which need a robot."""

from pathlib import Path

from selfmodel import arguments
from selfmodel.cli.commands import ExportTable, ImportRecording
from selfmodel.cli.inputs import check_log_name
from selfmodel.cli.output import print_json, print_lines
from selfmodel.cli.tables import show
from selfmodel.errors import InputError, counted
from selfmodel.logs.files import refuse_existing
from selfmodel.logs.recordings import suggest, tables
from selfmodel.logs.recordings.importer import ImportedTrial, import_recording, write_recording
from selfmodel.logs.recordings.mapping_file import RecordingMapping, read_mapping
from selfmodel.robot.robot import Robot


def import_(options: ImportRecording) -> None:
    """Import a recording of a robot as a trial log: a bag of ROS, without ROS, or a table."""
    source, out, name = options.recording, options.out, options.robot
    if options.suggest:
        if name is None or out or options.mapping or options.run or options.as_json:
            raise InputError(
                "--suggest needs --robot ROBOT, and excludes --out, --mapping, --run and --json"
            )
        robot, is_file = arguments.recorded_robot(name, None), arguments.is_model(name)
        text = suggest.suggest(source, robot, name, with_timestep=is_file)
        print_lines(*text.removesuffix("\n").split("\n"))
        return
    if name is not None:
        raise InputError("--robot is for --suggest: the robot of an import is in its mapping")
    if out is None or options.mapping is None:
        raise InputError(
            "an import needs --out TRIAL.mcap and --mapping MAP.toml; "
            "--suggest --robot ROBOT prints a mapping to edit"
        )
    check_log_name(out)
    refuse_existing(out)
    mapping, folder = read_mapping(options.mapping), options.mapping.parent
    robot, controller = _mapped_robot(mapping, folder), None
    if mapping.trial.controller is not None:
        try:
            controller = arguments.read_controller(folder / mapping.trial.controller, robot)
        except InputError as error:
            raise mapping.error(("controller",), str(error)) from error
    recording = import_recording(source, mapping, robot, options.run)
    write_recording(out, robot, recording, mapping, controller)
    if options.as_json:
        facts = {
            "log": str(out),
            "robot": mapping.trial.robot,
            "steps": recording.trajectory.steps,
            "valid": recording.valid,
            "topics": {topic: found.facts() for topic, found in recording.qualities.items()},
            "clock": recording.clock,
            "notes": list(recording.notes),
        }
        print_json(facts)
    else:
        _print_import(out, recording)


def _mapped_robot(mapping: RecordingMapping, folder: Path) -> Robot:
    """Returns the robot of a mapping: one of selfmodel's, or of a model file beside the mapping."""
    name, timestep = mapping.trial.robot, mapping.trial.control_timestep
    own = not arguments.is_model(name)
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
    tables.writer_of(options.out)
    refuse_existing(options.out)
    (found,) = arguments.read_logs([options.log])
    names, steps = tables.export(options.out, found.trial.trajectory), found.trial.trajectory.steps
    if options.as_json:
        print_json({"table": str(options.out), "rows": steps, "columns": list(names)})
    else:
        rows, columns = counted(steps, "row"), counted(len(names), "column")
        print_lines(f"{rows} of {columns}: {options.out}")
