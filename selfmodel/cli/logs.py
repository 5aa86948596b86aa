"""``selfmodel logs``: commands that work on log files."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import typer

from selfmodel import arguments
from selfmodel.arguments import is_model
from selfmodel.cli.commands import ExportTable, ImportRecording, LogInfo, SalvageLog, Verify
from selfmodel.cli.inputs import check_log_name
from selfmodel.cli.output.plain import counted
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.cli.output.tables import show
from selfmodel.cli.view import layout_path
from selfmodel.controllers.controller import Controller
from selfmodel.errors import InputError
from selfmodel.logs import LogError, TrialLog
from selfmodel.logs.export import export as write_table, writer_of
from selfmodel.logs.files import refuse_existing
from selfmodel.logs.inspection import Info, read_info, verify as check
from selfmodel.logs.recordings.importer import ImportedTrial, import_recording, write_recording
from selfmodel.logs.recordings.mapping_file import RecordingMapping, read_mapping
from selfmodel.logs.recordings.suggest import suggest as suggest_mapping
from selfmodel.logs.salvage import salvage as save, salvageable_steps
from selfmodel.robot.robot import Robot


def info(options: LogInfo) -> None:
    """Show what logs contain, and how to open them in a viewer."""
    found = [_info_facts(path) for path in options.files]
    if options.as_json:
        print_json({"files": found})
    else:
        for one in found:
            _print_info(one)
        if any("error" not in one for one in found):
            print_lines(*_viewers())
    raise typer.Exit(1 if any("error" in one for one in found) else 0)


def _viewers() -> tuple[str, ...]:
    return (
        "To view a log:",
        f"  Foxglove  Open local file; import the layout {layout_path()}",
        "  Rerun     selfmodel view FILE.mcap   (pip install 'selfmodel[rerun]')",
    )


def _info_facts(path: Path) -> dict[str, Any]:
    try:
        return _as_object(path, read_info(path))
    except LogError as error:
        return _damage(path, error, salvageable_steps(path))
    except InputError as error:
        return _damage(path, error, 0)


def _damage(path: Path, error: Exception, steps: int) -> dict[str, Any]:
    return {
        "file": str(path),
        "error": str(error),
        "kind": type(error).__name__,
        "salvageable_steps": steps,
    }


def _as_object(path: Path, found: Info) -> dict[str, Any]:
    trial = found.log.trial
    displacement = trial.displacement
    return {
        "file": str(path),
        "bytes": found.bytes,
        "robot": trial.robot,
        "trial": trial.plan.name,
        "stage": trial.plan.stage,
        "status": found.log.status,
        "reason": found.log.reason,
        "steps": trial.behaviour.steps,
        "planned_steps": trial.plan.steps,
        "control_timestep": found.log.control_timestep,
        "seed": trial.plan.seed,
        "displacement": displacement if math.isfinite(displacement) else None,
        "driver": found.driver,
        "software": dict(found.log.software),
        "topics": {
            name: {"type": topic.type, "messages": topic.messages, "rate": round(topic.rate, 3)}
            for name, topic in found.topics.items()
        },
        "attachments": dict(found.attachments),
        "records": list(found.records),
        "observed": {signal: round(share, 6) for signal, share in found.observed.items()},
        "clock": _clock(found.log),
        "truth": "hidden" if found.has_truth else "unknown",
        "source": dict(found.source),
        "digest": found.digest,
    }


def _clock(log: TrialLog) -> dict[str, int] | None:
    if log.timing is None:
        return None
    return {"late": int(log.timing.late.sum()), "missing": int(log.timing.missing.sum())}


def _print_info(one: dict[str, Any]) -> None:
    if "error" in one:
        print_lines(
            f"error: {one['error']}",
            f"complete steps that can be salvaged: {one['salvageable_steps']}",
            "",
        )
        return
    seconds = one["steps"] * one["control_timestep"]
    dx = one["displacement"]
    print_lines(
        f"{one['file']} ({one['bytes'] / 1000:.0f} kB)",
        f"trial {one['trial']} ({one['stage']}) of {one['robot']}, {one['status']}"
        f"{': ' + one['reason'] if one['reason'] else ''}",
        f"{one['steps']} of {one['planned_steps']} steps of {one['control_timestep']:g} s = "
        f"{seconds:.2f} s; {'displacement unknown' if dx is None else f'{dx:.3f} m forward'}; "
        f"seed {one['seed']}",
        f"driven by {one['driver']}",
        f"written with {', '.join(f'{name} {text}' for name, text in one['software'].items())}",
        f"true hypothesis: {_TRUTH[one['truth']]}",
        f"SHA-256 {one['digest']}",
    )
    if clock := one["clock"]:
        late, missing = (
            counted(clock["late"], "step"),
            counted(clock["missing"], "observation"),
        )
        print_lines(f"clock: {late} late, {missing} missing")
    for name, text in one["source"].items():
        print_lines(f"{name}: {text if len(text) <= 100 else text[:97] + '...'}")
    rows = [
        (name, topic["type"], str(topic["messages"]), f"{topic['rate']:.1f}")
        for name, topic in one["topics"].items()
    ]
    show(("topic", "type", "messages", "Hz"), rows, texts=2)
    partly = {signal: share for signal, share in one["observed"].items() if share < 1}
    print_lines(
        "observed: everything"
        if not partly
        else "partly observed: "
        + ", ".join(f"{signal} {share:.1%}" for signal, share in partly.items())
    )
    sizes = ", ".join(f"{name} {size / 1000:.1f} kB" for name, size in one["attachments"].items())
    print_lines(f"attachments: {sizes}", "")


_TRUTH = {
    "hidden": "recorded in the log of a simulated robot; no diagnosis reads it",
    "unknown": "not recorded",
}


def verify(options: Verify) -> None:
    """Verify checksums, counts, digests, layout, times, names and the model of logs."""
    if options.expect and len(options.files) > 1:
        raise InputError(
            f"--expect is the SHA-256 of one log: give one log, got {len(options.files)}"
        )
    checked = [_checked(path, options.expect.lower()) for path in options.files]
    if options.as_json:
        print_json({"ok": all(one["ok"] for one in checked), "files": checked}, indent=None)
    else:
        print_lines(*map(_line, checked))
    raise typer.Exit(0 if all(one["ok"] for one in checked) else 1)


def _checked(path: Path, expected: str) -> dict[str, Any]:
    try:
        found = check(path, expected)
    except (LogError, InputError) as error:
        return {"file": str(path), "ok": False, "error": str(error), "kind": type(error).__name__}
    return {
        "file": str(path),
        "ok": True,
        "status": found.log.status,
        "reason": found.log.reason,
        "steps": found.log.trial.behaviour.steps,
        "model_loaded": found.model_loaded,
        "digest": found.digest,
    }


def _line(one: dict[str, Any]) -> str:
    if one["ok"]:
        unloaded = "" if one["model_loaded"] else " (without MuJoCo, its model was not loaded)"
        why = f" ({one['reason']})" if one["reason"] else ""
        steps = counted(one["steps"], "step")
        digest = f"SHA-256 {one['digest']}"
        return f"ok: {one['file']}: {steps}, {one['status']}{why}{unloaded}; {digest}"
    return f"error: {one['error']}"


def salvage(options: SalvageLog) -> None:
    """Save the steps before the first damage of a log in a new, valid one."""
    check_log_name(options.out)
    saved = save(options.file, options.out)
    if options.as_json:
        print_json({"source": str(options.file), **dataclasses.asdict(saved)}, indent=None)
        return
    print_lines(
        f"saved {saved.steps} of {counted(saved.planned, 'step')} in {saved.log}",
        f"the first damage of {options.file}: {saved.damage}",
    )


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
        "steps": recording.behaviour.steps,
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
        f"{counted(recording.behaviour.steps, 'step')}: {out}",
    )


def _number(value: float | None, scale: float = 1.0) -> str:
    return "-" if value is None else f"{value * scale:.1f}"


def export(options: ExportTable) -> None:
    """Write the signals of a trial log as a table: one row per control step."""
    writer_of(options.out)
    refuse_existing(options.out)
    (found,) = arguments.read_logs([options.log])
    behaviour = found.trial.behaviour
    names = write_table(options.out, behaviour)
    if options.as_json:
        print_json({"table": str(options.out), "rows": behaviour.steps, "columns": list(names)})
    else:
        print_lines(
            f"{counted(behaviour.steps, 'row')} of {counted(len(names), 'column')}: {options.out}"
        )
