"""``selfmodel logs verify``: every check on every log."""

import json
from pathlib import Path
from typing import Any

import typer

from selfmodel.cli.options import DEFAULT_BUDGET, FileBudget, Json, LogFiles
from selfmodel.cli.output.plain import counted, plain
from selfmodel.errors import InputError
from selfmodel.logs import LogError
from selfmodel.logs.verify import verify as check
from selfmodel.sandbox.budget import Budget


def verify(files: LogFiles, *, budget: FileBudget = DEFAULT_BUDGET, as_json: Json = False) -> None:
    """Verify checksums, counts, digests, layout, times, names and the model of logs.

    The exit status is 0 if every log is good, otherwise 1.
    """
    allowed = Budget.parse(budget)
    checked = [_checked(path, allowed) for path in files]
    if as_json:
        typer.echo(json.dumps({"ok": all(one["ok"] for one in checked), "files": checked}))
    else:
        for one in checked:
            typer.echo(plain(_line(one)))
    raise typer.Exit(0 if all(one["ok"] for one in checked) else 1)


def _checked(path: Path, budget: Budget) -> dict[str, Any]:
    try:
        log, loaded = check(path, budget)
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
        unloaded = "" if one["model_loaded"] else " (without MuJoCo, its model was not loaded)"
        why = f" ({one['reason']})" if one["reason"] else ""
        steps = counted(one["steps"], "step")
        return f"ok: {one['file']}: {steps}, {one['status']}{why}{unloaded}"
    return f"error: {one['error']}"
