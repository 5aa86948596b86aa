"""``selfmodel logs``: commands that read log files, without MuJoCo."""

import dataclasses
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import typer

from selfmodel.cli.commands import LogInfo, SalvageLog, Verify
from selfmodel.cli.inputs import check_log_name
from selfmodel.cli.output import print_json, print_lines
from selfmodel.cli.tables import show
from selfmodel.errors import InputError, counted
from selfmodel.logs import LogError, inspection, salvage as salvaging

_TRUTH = {
    "hidden": "recorded in the log of a simulated robot; no diagnosis reads it",
    "unknown": "not recorded",
}


def info(options: LogInfo) -> None:
    """Show what logs contain, and how to open them in a viewer."""
    found = [_info(path) for path in options.files]
    if options.as_json:
        print_json({"files": found})
    else:
        for one in found:
            _print_info(one)
        if any("error" not in one for one in found):
            print_lines(
                "To view a log:",
                f"  Foxglove  Open local file; import the layout {layout_path()}",
                "  Rerun     selfmodel view FILE.mcap   (pip install 'selfmodel[rerun]')",
            )
    raise typer.Exit(1 if any("error" in one for one in found) else 0)


def layout_path() -> Path:
    """Returns the path of the installed layout for Foxglove and Lichtblick."""
    with as_file(files("selfmodel.cli") / "foxglove-layout.json") as path:
        return path


def _info(path: Path) -> dict[str, Any]:
    try:
        return inspection.read_info(path)
    except (LogError, InputError) as error:
        is_log = isinstance(error, LogError)
        return _error(path, error) | {
            "salvageable_steps": salvaging.salvageable_steps(path) if is_log else 0
        }


def _error(path: Path, error: Exception) -> dict[str, Any]:
    return {"file": str(path), "error": str(error), "kind": type(error).__name__}


def _print_info(one: dict[str, Any]) -> None:
    if "error" in one:
        salvageable = f"complete steps that can be salvaged: {one['salvageable_steps']}"
        print_lines(f"error: {one['error']}", salvageable, "")
        return
    seconds, dx = one["steps"] * one["control_timestep"], one["displacement"]
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
        late, missing = counted(clock["late"], "step"), counted(clock["missing"], "observation")
        print_lines(f"clock: {late} late, {missing} missing")
    for name, text in one["source"].items():
        print_lines(f"{name}: {text if len(text) <= 100 else text[:97] + '...'}")
    rows = [
        (name, topic["type"], str(topic["messages"]), f"{topic['rate']:.1f}")
        for name, topic in one["topics"].items()
    ]
    show(("topic", "type", "messages", "Hz"), rows, texts=2)
    partly = [f"{name} {share:.1%}" for name, share in one["observed"].items() if share < 1]
    sizes = ", ".join(f"{name} {size / 1000:.1f} kB" for name, size in one["attachments"].items())
    print_lines(
        f"partly observed: {', '.join(partly)}" if partly else "observed: everything",
        f"attachments: {sizes}",
        "",
    )


def verify(options: Verify) -> None:
    """Verify checksums, counts, digests, layout, times, names and the model of logs."""
    if options.expect and len(options.files) > 1:
        raise InputError(
            f"--expect is the SHA-256 of one log: give one log, got {len(options.files)}"
        )
    checked = [_checked(path, options.expect.lower()) for path in options.files]
    good = all(one["ok"] for one in checked)
    if options.as_json:
        print_json({"ok": good, "files": checked}, indent=None)
    else:
        print_lines(*map(_line, checked))
    raise typer.Exit(0 if good else 1)


def _checked(path: Path, expected: str) -> dict[str, Any]:
    try:
        found = inspection.verify(path, expected)
    except (LogError, InputError) as error:
        return {"ok": False} | _error(path, error)
    return {
        "file": str(path),
        "ok": True,
        "status": found.log.status,
        "reason": found.log.reason,
        "steps": found.log.trial.trajectory.steps,
        "model_loaded": found.model_loaded,
        "digest": found.digest,
    }


def _line(one: dict[str, Any]) -> str:
    if not one["ok"]:
        return f"error: {one['error']}"
    unloaded = "" if one["model_loaded"] else " (without MuJoCo, its model was not loaded)"
    why = f" ({one['reason']})" if one["reason"] else ""
    steps, digest = counted(one["steps"], "step"), f"SHA-256 {one['digest']}"
    return f"ok: {one['file']}: {steps}, {one['status']}{why}{unloaded}; {digest}"


def salvage(options: SalvageLog) -> None:
    """Save the steps before the first damage of a log in a new, valid one."""
    check_log_name(options.out)
    saved = salvaging.salvage(options.file, options.out)
    if options.as_json:
        print_json({"source": str(options.file), **dataclasses.asdict(saved)}, indent=None)
        return
    print_lines(
        f"saved {saved.steps} of {counted(saved.planned, 'step')} in {saved.log}",
        f"the first damage of {options.file}: {saved.damage}",
    )
