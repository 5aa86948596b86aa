"""Compares the results of two versions of selfmodel to the last bit.

``python -m benchmarks.same_bits record --python PYTHON -o FILE.json`` runs a fixed list of commands
(``benchmarks/same_bits/plan.py``) with the selfmodel that PYTHON imports, and writes one JSON file:
every number of every ``--json`` output as a hexadecimal float, and digests of every log and file
that a command wrote. ``python -m benchmarks.same_bits compare OLD NEW`` prints a line a command and
exits with 1 if a result differs. Times, versions and sentences are left out. Keys that
only NEW has are no difference. selfmodel itself is never imported here: only its command line, its
JSON and its logs are used, which stay the same while modules move.

``benchmarks/same_bits/same_bits_0.1.json`` was recorded with version 0.1 (commit b097c0d), all
parts but ``table-one``, whose reference is ``docs/results.jsonl``: all 74 runs take about two hours
of one processor, the other parts about ten minutes. The scenarios of ``suite-walker-walk`` differ
from it since copies of MJCF files have no warm start. Bits are those of one version of MuJoCo and
of numpy and of one processor family: where ``compare`` prints that these differ, record both
versions on one machine. MuJoCo's threads do not matter; those of BLAS are set to one.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.same_bits.log_digest import bytes_digest, log_digests
from benchmarks.same_bits.plan import PARTS, Scenario, scenarios, table_one_name

Items = dict[str, Any]
"""Results by ``SCENARIO:COMMAND``."""

MADE_WITH = "made_with"
MACHINE = """\
import json, platform, mujoco, numpy, selfmodel, sys
print(selfmodel.__file__, file=sys.stderr)
print(json.dumps({"mujoco": mujoco.__version__, "numpy": numpy.__version__,
                  "machine": platform.machine()}))
"""
LEFT_OUT = ("seconds", "mujoco", "test")
"""Keys of JSON that are times, versions or sentences."""

TABLE_ONE_KEYS = (
    *("robot", "case", "truth", "comparator", "gap", "seed", "diagnosis", "correct"),
    *("displacement", "recovery", "physical_trials"),
)
"""Keys of a recovery in ``docs/results.jsonl``."""

SEARCHED = ("diagnostic", "distinct_hypotheses")
"""Keys of its ``evaluations``; the others do not count the gait, which its runs shared."""


def main() -> None:
    """Records or compares."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.same_bits", description=__doc__.partition("\n\n")[0]
    )
    commands = parser.add_subparsers(required=True)
    recording = commands.add_parser("record", help="run the commands and write their results")
    recording.add_argument("--python", default=sys.executable, help="interpreter with selfmodel")
    recording.add_argument("--tree", type=Path, help="working tree to import selfmodel from")
    recording.add_argument("-o", "--out", type=Path, required=True)
    recording.add_argument("--jobs", type=int, default=1, help="scenarios that run at once")
    recording.add_argument(
        "--resume", action="store_true", help="keep what FILE.json has of the same version"
    )
    recording.set_defaults(run=record)
    comparing = commands.add_parser("compare", help="compare two records; exits with 1 or 0")
    comparing.add_argument("old", type=Path, help="a record, or docs/results.jsonl")
    comparing.add_argument("new", type=Path, help="a record")
    comparing.set_defaults(run=compare)
    for command in (recording, comparing):
        command.add_argument(
            "--only",
            type=lambda text: tuple(text.split(",")),
            help="beginnings of names, such as trials,recoveries/hexapod; all but table-one",
        )
    options = parser.parse_args()
    options.run(options)


def record(options: argparse.Namespace) -> None:
    """Runs the chosen scenarios; after each, the file has one line for each command so far."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    environment |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    if options.tree is not None:
        environment["PYTHONPATH"] = str(options.tree.resolve())
    # Not resolved: the interpreter of a virtual environment is a link.
    python = os.path.abspath(options.python)  # noqa: PTH100 - Path.resolve follows links
    with tempfile.TemporaryDirectory() as folder:
        ask = (python, "-c", MACHINE)
        machine = subprocess.run(
            ask, cwd=folder, env=environment, check=True, stdout=subprocess.PIPE, text=True
        )
    items = _read(options.out) if options.resume and options.out.exists() else {}
    items[MADE_WITH] = json.loads(machine.stdout)
    done = {name.partition(":")[0] for name in items}
    only = options.only or PARTS[:-1]
    chosen = [s for s in scenarios() if _is_chosen(s.name, only) and s.name not in done]
    with ThreadPoolExecutor(options.jobs) as pool:
        for found in pool.map(partial(_run, python, environment), chosen):
            print(*found, sep="\n", flush=True)
            items |= found
            _write(options.out, items)


def compare(options: argparse.Namespace) -> None:
    """Prints for each command whether its results are the same; exits with 1 if one is not."""
    old, new = _read(options.old), _read(options.new)
    if old.pop(MADE_WITH, None) not in (None, made_with := new.pop(MADE_WITH)):
        print(f"the records were made with different versions; the new one with {made_with}")
    names = [name for name in {**old, **new} if _is_chosen(name, options.only or ("",))]
    different = 0
    for name in names:
        if name not in old or name not in new:
            where = f"only in {options.new if name in new else options.old}"
        else:
            result = _row(new[name]["json"]) if options.old.suffix == ".jsonl" else new[name]
            where = next(_differences(old[name], result), "")
        different += bool(where)
        print(f"{name}: {f'different: {where}' if where else 'same'}")
    print(f"{len(names) - different} of {len(names)} the same to the last bit")
    sys.exit(1 if different or not names else 0)


def _is_chosen(name: str, only: tuple[str, ...]) -> bool:
    return name.startswith(only)


def _run(python: str, environment: dict[str, str], scenario: Scenario) -> Items:
    """Runs a scenario in a folder of its own and returns its results."""
    found: Items = {}
    with tempfile.TemporaryDirectory() as name:
        folder, seen = Path(name), set[Path]()
        for command, arguments in scenario.commands.items():
            done = subprocess.run(
                (python, "-m", "selfmodel", *arguments),
                cwd=folder,
                env=environment,
                capture_output=True,
                text=True,
                check=False,
            )
            if done.returncode:
                raise SystemExit(f"{scenario.name}: {' '.join(arguments)}:\n{done.stderr}")
            written = {path for path in folder.rglob("*") if path.is_file()} - seen
            seen |= written
            found[f"{scenario.name}:{command}"] = {
                "json": _exact(json.loads(done.stdout)),
                "files": {
                    path.relative_to(folder).as_posix(): _digests(path) for path in sorted(written)
                },
            }
    return found


def _digests(path: Path) -> Any:  # noqa: ANN401 - JSON
    if path.suffix == ".mcap":
        return log_digests(path)
    if path.name == "diagnoses.json":
        diagnoses = json.loads(path.read_text(encoding="utf-8"))
        return [bytes_digest(json.dumps(_exact(found)).encode()) for found in diagnoses]
    # result.json is the object that the command prints, with its time.
    return None if path.name == "result.json" else bytes_digest(path.read_bytes())


def _exact(value: Any) -> Any:  # noqa: ANN401 - JSON
    """Returns JSON with floats in hexadecimal, and lists of floats as digests, less LEFT_OUT."""
    if isinstance(value, dict):
        return {key: _exact(item) for key, item in value.items() if key not in LEFT_OUT}
    if isinstance(value, list):
        items = [_exact(item) for item in value]
        numbers = bool(value) and all(isinstance(item, float) for item in value)
        return bytes_digest(json.dumps(items).encode()) if numbers else items
    return value.hex() if isinstance(value, float) else value


def _differences(old: Any, new: Any, where: str = "") -> Iterator[str]:  # noqa: ANN401 - JSON
    """Yields the fields that differ, as paths with both values."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key, item in old.items():
            if key in new:
                yield from _differences(item, new[key], f"{where}.{key}")
            else:
                yield f"{where}.{key}: missing"
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for k, (one, other) in enumerate(zip(old, new, strict=True)):
            yield from _differences(one, other, f"{where}[{k}]")
    elif old != new or type(old) is not type(new):
        yield f"{where}: {old} became {new}"


def _read(path: Path) -> Items:
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".jsonl":
        found: Items = json.loads(text)
        return found
    rows = [row for row in map(json.loads, text.splitlines()) if "case" in row]
    return {
        f"{table_one_name(row['robot'], row['case'], row['seed'])}:recover": _row(_exact(row))
        for row in rows
    }


def _write(path: Path, items: Items) -> None:
    """Writes one line for each command."""
    lines = (json.dumps({k: v}, separators=(",", ":"))[1:-1] for k, v in items.items())
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def _row(found: dict[str, Any]) -> dict[str, Any]:
    """Returns the part of a recovery that a row of ``docs/results.jsonl`` has, too."""
    searched = {key: found["evaluations"][key] for key in SEARCHED}
    return {**{key: found[key] for key in TABLE_ONE_KEYS}, "evaluations": searched}


if __name__ == "__main__":
    main()
