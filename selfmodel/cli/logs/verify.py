"""``selfmodel logs verify``: every check, on every file."""

import json
from pathlib import Path
from typing import Any

import typer

from selfmodel.cli.options import Json, LogFiles
from selfmodel.cli.output.plain import plain
from selfmodel.errors import InputError


def verify(files: LogFiles, *, as_json: Json = False) -> None:
    """Verify logs: checksums, counts, digests, layout, times, names, model. Exits with 0 or 1."""
    checked = [_checked(path) for path in files]
    if as_json:
        typer.echo(json.dumps({"ok": all(one["ok"] for one in checked), "files": checked}))
    else:
        for one in checked:
            typer.echo(plain(_line(one)))
    raise typer.Exit(0 if all(one["ok"] for one in checked) else 1)


def _checked(path: Path) -> dict[str, Any]:
    from selfmodel.logs.errors import LogError  # noqa: PLC0415  # with the other work
    from selfmodel.logs.verify import verify as check  # noqa: PLC0415  # the same

    try:
        log, loaded = check(path)
    except (LogError, InputError) as error:
        return {"file": str(path), "ok": False, "error": str(error), "kind": type(error).__name__}
    return {
        "file": str(path),
        "ok": True,
        "status": log.status,
        "reason": log.reason,
        "steps": log.trial.behaviour.steps,
        "model_loaded": loaded,
    }


def _line(one: dict[str, Any]) -> str:
    if one["ok"]:
        unloaded = "" if one["model_loaded"] else " (no MuJoCo here: its model was not loaded)"
        why = f" ({one['reason']})" if one["reason"] else ""
        return f"ok: {one['file']}: {one['steps']} steps, {one['status']}{why}{unloaded}"
    return f"error: {one['error']}"
