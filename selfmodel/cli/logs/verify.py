"""``selfmodel logs verify``: every check on every log."""

from pathlib import Path
from typing import Annotated, Any

import typer

from selfmodel.cli.arguments.options import Json, LogFiles
from selfmodel.cli.output.plain import counted
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.errors import InputError
from selfmodel.logs import LogError
from selfmodel.logs.inspection import verify as check

Expect = Annotated[
    str,
    typer.Option(
        metavar="SHA256", help="SHA-256 that the one file must have, as from `logs verify`."
    ),
]


def verify(
    files: LogFiles,
    *,
    expect: Expect = "",
    as_json: Json = False,
) -> None:
    """Verify checksums, counts, digests, layout, times, names and the model of logs.

    The exit status is 0 if every log is good, otherwise 1.
    """
    if expect and len(files) > 1:
        raise InputError(f"--expect is the SHA-256 of one log: give one log, got {len(files)}")
    checked = [_checked(path, expect.lower()) for path in files]
    if as_json:
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
