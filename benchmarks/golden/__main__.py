"""The golden set: results of a fixed list of commands, recorded with two versions and compared.

    git worktree add ../old v0.1
    python -m benchmarks.foreign generate runs/material --gaps large --trials 1 --duration 6
    python -m benchmarks.golden record --tree ../old --material runs/material -o old.json
    python -m benchmarks.golden record --material runs/material -o new.json
    python -m benchmarks.golden compare old.json new.json

``record`` runs the commands of ``benchmarks/golden/plan.py`` with the selfmodel of a working tree
and writes one JSON file: every number of every ``--json`` output, and digests of every log and file
that a command wrote. selfmodel is never imported here: only its command line, its JSON and its logs
are read, which stay the same while modules move. ``compare`` prints a line for each command whose
result differs, and exits with 1 if there is one; ``same to 1e-9`` means that only the last
digits of floats differ, and counts as a difference with ``--exact``. Times, versions and sentences
are left out. Keys that only NEW has are no difference.

Bits are those of one version of MuJoCo and of numpy and of one processor family, so both sides are
recorded on one machine. The whole list takes about an hour of one processor.
"""

import argparse
import json
import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from benchmarks.golden.log_digest import bytes_digest, log_digests
from benchmarks.golden.plan import ROOT, Commands, scenarios

Items = dict[str, Any]
"""Results by ``SCENARIO:COMMAND``."""

LEFT_OUT = (
    *("seconds", "mujoco", "test", "selfmodel", "software", "sentences"),
    *("path", "folder", "log", "file", "digest"),
)
"""Keys of JSON that are times, versions, sentences, places or digests of whole files."""

RENAMED = {"rivals": "indistinguishable", "unseen": "undetectable", "outside": "unsearched"}
"""Keys of JSON by their names before 0.2."""

NO_RESULTS = (".json", ".jsonl", ".pdf", ".png", ".svg")
"""Files with times and versions: the numbers of the JSON are those that the command prints."""

LONGEST_LIST = 24
"""Floats of a list that are kept as numbers; of a longer one, a digest is."""

TOLERANCE = 1e-9
LONGEST_LINE = 200


def main() -> None:
    """Records or compares."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.golden", description=__doc__.partition("\n\n")[0]
    )
    commands = parser.add_subparsers(required=True)
    recording = commands.add_parser("record", help="run the commands and write their results")
    recording.add_argument("--tree", type=Path, default=ROOT, help="working tree of selfmodel")
    recording.add_argument("--material", type=Path, help="folder of benchmarks.foreign generate")
    recording.add_argument("-o", "--out", type=Path, required=True)
    recording.add_argument("--jobs", type=int, default=1, help="scenarios that run at once")
    recording.add_argument("--resume", action="store_true", help="keep what FILE.json has")
    recording.set_defaults(run=record)
    comparing = commands.add_parser("compare", help="compare two records; exits with 1 or 0")
    comparing.add_argument("old", type=Path)
    comparing.add_argument("new", type=Path)
    comparing.add_argument("--exact", action="store_true", help="to the last bit")
    comparing.set_defaults(run=compare)
    for command in (recording, comparing):
        command.add_argument(
            "--only",
            type=lambda text: tuple(text.split(",")),
            default=("",),
            help="beginnings of names, such as trials,recoveries/hexapod [all]",
        )
    options = parser.parse_args()
    options.run(options)


def record(options: argparse.Namespace) -> None:
    """Runs the chosen scenarios; after each, the file has one line for each command so far."""
    environment = dict(os.environ) | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    environment["PYTHONPATH"] = str(options.tree.resolve())
    items = _read(options.out) if options.resume and options.out.exists() else {}
    done = {name.partition(":")[0] for name in items}
    chosen = [
        (name, commands)
        for name, commands in scenarios(options.material)
        if name.startswith(options.only) and name not in done
    ]
    with ThreadPoolExecutor(options.jobs) as pool:
        for results in pool.map(lambda scenario: _run(environment, *scenario), chosen):
            print(*results, sep="\n", flush=True)
            items |= results
            _write(options.out, items)


def compare(options: argparse.Namespace) -> None:
    """Prints each command whose results differ, and where; exits with 1 if there is one."""
    old, new = (
        {name: item for name, item in _read(path).items() if name.startswith(options.only)}
        for path in (options.old, options.new)
    )
    counts = dict.fromkeys(("same", "same to 1e-9", "different"), 0)
    for name in sorted(old.keys() & new.keys()):
        exact = list(_differences(old[name], new[name], 0.0))
        close = list(_differences(old[name], new[name], TOLERANCE))
        outcome = "different" if close else "same to 1e-9" if exact else "same"
        counts[outcome] += 1
        if outcome != "same":
            shown = (line[:LONGEST_LINE] for line in (close or exact)[:8])
            print(f"{name}: {outcome}", *shown, sep="\n    ")
    missing = sorted(old.keys() ^ new.keys())
    for name in missing:
        print(f"{name}: only in {options.new if name in new else options.old}")
    print(", ".join(f"{count} {outcome}" for outcome, count in counts.items()))
    bad = counts["different"] + len(missing) + (counts["same to 1e-9"] if options.exact else 0)
    sys.exit(1 if bad or not old else 0)


def _run(environment: dict[str, str], name: str, commands: Commands) -> Items:
    """Runs a scenario in a folder of its own and returns its results; a refusal is a result."""
    results: Items = {}
    with tempfile.TemporaryDirectory() as place:
        folder, seen = Path(place), set[Path]()
        for command, arguments in commands.items():
            done = subprocess.run(
                (sys.executable, "-m", "selfmodel", *arguments.split()),
                cwd=folder,
                env=environment,
                capture_output=True,
                text=True,
                check=False,
            )
            written = {path for path in folder.rglob("*") if path.is_file()} - seen
            seen |= written
            results[f"{name}:{command}"] = {
                "exit": done.returncode,
                "output": _output(done.stdout) if not done.returncode else done.stderr[-500:],
                "files": {
                    path.relative_to(folder).as_posix(): _content(path) for path in sorted(written)
                },
            }
    return results


def _output(text: str) -> Any:  # noqa: ANN401 - JSON
    try:
        return _numbers(json.loads(text))
    except json.JSONDecodeError:
        return text


def _content(path: Path) -> Any:  # noqa: ANN401 - JSON
    """Returns the numbers of a written file, or its digest."""
    if path.suffix == ".mcap":
        return log_digests(path)
    if path.name == "diagnoses.json":
        return _numbers(json.loads(path.read_text(encoding="utf-8")))
    return None if path.suffix in NO_RESULTS else bytes_digest(path.read_bytes())


def _numbers(value: Any) -> Any:  # noqa: ANN401 - JSON
    """Returns JSON less LEFT_OUT, with long lists of numbers as digests."""
    if isinstance(value, dict):
        return {key: _numbers(item) for key, item in value.items() if key not in LEFT_OUT}
    if isinstance(value, list):
        items = [_numbers(item) for item in value]
        numbers = all(isinstance(item, float | int) for item in items)
        long = numbers and len(items) > LONGEST_LIST
        return bytes_digest(json.dumps(items).encode()) if long else items
    return value


def _differences(old: Any, new: Any, tolerance: float, where: str = "") -> Iterator[str]:  # noqa: ANN401 - JSON
    """Yields the fields that differ, as paths with both values."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key, item in old.items():
            if key in new:
                yield from _differences(item, new[key], tolerance, f"{where}.{key}")
            else:
                yield f"{where}.{key}: missing"
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for k, (one, other) in enumerate(zip(old, new, strict=True)):
            yield from _differences(one, other, tolerance, f"{where}[{k}]")
    elif isinstance(old, float) and isinstance(new, float) and tolerance:
        if not math.isclose(old, new, rel_tol=tolerance, abs_tol=tolerance):
            yield f"{where}: {old} became {new}"
    elif (old != new or type(old) is not type(new)) and not (_is_sha256(old) and _is_sha256(new)):
        yield f"{where}: {old} became {new}"


def _is_sha256(value: object) -> bool:
    """Returns whether a value is the digest of a whole file, which has the version in it."""
    return isinstance(value, str) and re.fullmatch("[0-9a-f]{64}", value) is not None


def _read(path: Path) -> Items:
    text = path.read_text(encoding="utf-8")
    items: Items = json.loads(
        text, object_hook=lambda keys: {RENAMED.get(key, key): value for key, value in keys.items()}
    )
    return items


def _write(path: Path, items: Items) -> None:
    """Writes one line for each command."""
    lines = (json.dumps({k: v}, separators=(",", ":"))[1:-1] for k, v in items.items())
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
