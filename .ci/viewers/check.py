"""Proves that logs open in other people's tools: Foxglove's parser, Rerun and pymcap-cli.

Usage: python .ci/viewers/check.py LOG.mcap...
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from selfmodel.errors import InputError
from selfmodel.logs import read_log
from selfmodel.logs.errors import LogError

HERE = Path(__file__).parent
ENVIRONMENTS = HERE.parents[1] / ".viewers"
PYMCAP = ENVIRONMENTS / "pymcap" / "bin" / "pymcap-cli"
RERUN = Path(sys.executable).parent


class ProofError(Exception):
    """A tool did not say what it must of a sound log."""


def main(logs: list[Path]) -> None:
    """Prints what each tool says of each log; exits with 1 where one of them complains."""
    if not logs:
        sys.exit("usage: python .ci/viewers/check.py LOG.mcap...")
    failed = 0
    for log in logs:
        for tool, proof in PROOFS.items():
            try:
                sys.stdout.write(f"{log.name}: {tool}: {proof(log)}\n")
            except ProofError as error:
                failed += 1
                sys.stdout.write(f"{log.name}: {tool}: FAILED: {error}\n")
    if failed:
        sys.exit(f"{failed} of {len(logs) * len(PROOFS)} proofs failed")


def foxglove(log: Path) -> str:
    """Every message decodes with Foxglove's parser, and there are as many as the log says."""
    return said("node", HERE / "decode.mjs", log).strip()


def doctor(log: Path) -> str:
    """The file is an MCAP file as the specification wants it, without even a warning."""
    lines = said(PYMCAP, "doctor", "--format", "jsonl", log).splitlines()
    summary = json.loads(lines[-1])
    if len(lines) > 1 or not summary["complete"] or summary["errors"] or summary["warnings"]:
        raise ProofError("expected a doctor with nothing to say, got " + " ".join(lines))
    return f"{summary['records']} records, no error, no warning"


def rerun(log: Path) -> str:
    """Rerun plots the joint positions: as Scalars, with a row a step, bit by bit those logged."""
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(folder) / "log.rrd"
        # Without a name of our own, Rerun warns that it must make one of the file's.
        name = ("--application-id", "selfmodel")
        said(RERUN / "rerun", "mcap", "convert", *name, log, "-o", recording, quiet=True)
        said(RERUN / "rerun", "rrd", "verify", recording, quiet=True)
        positions = said(RERUN / "python", HERE / "scalars.py", recording, "/joint_states/position")
    rows = [json.loads(line) for line in positions.splitlines()]
    if not rows:
        raise ProofError("expected Scalars at /joint_states/position, got none")
    try:
        trajectory = read_log(log).trial.trajectory
    except (InputError, LogError) as error:
        raise ProofError(f"there is nothing to compare with: {error}") from error
    if len(rows) != trajectory.steps:
        raise ProofError(f"expected {trajectory.steps} rows of positions, got {len(rows)}")
    expected = list(trajectory.names.hinges)
    strange = [row["names"] for row in rows if row["names"] != expected]
    if strange:
        raise ProofError(f"expected series named {expected}, got {strange[0]}")
    if [row["time"] for row in rows] != np.rint(trajectory.time * 1e9).astype(int).tolist():
        raise ProofError("the rows' times are not those of the log")
    shown = np.array([row["numbers"] for row in rows])
    if not np.array_equal(shown, trajectory.signals["joint_positions"], equal_nan=True):
        raise ProofError("the numbers at /joint_states/position are not those of the log")
    return f"{len(rows)} rows of {len(expected)} joint positions as Scalars, equal to the log's"


def view(log: Path) -> str:
    """The file that `selfmodel view` writes is one that Rerun verifies without a warning."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "view.rrd"
        said(RERUN / "selfmodel", "view", log, "-o", out)
        said(RERUN / "rerun", "rrd", "verify", out, quiet=True)
        return f"{out.stat().st_size} bytes with both bodies, verified"


def said(*command: str | Path, quiet: bool = False) -> str:
    """Returns a tool's standard output.

    Args:
        command: What to run.
        quiet: Whether a warning on standard error is a failure: Rerun exits with 0 beside one.

    Raises:
        ProofError: The tool says that something is wrong; in its own words.
    """
    environment = os.environ | {"RERUN_ANALYTICS": "0", "NO_COLOR": "1", "COLUMNS": "200"}
    done = subprocess.run(
        [str(part) for part in command],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
        timeout=300,
    )
    complaints = [line for line in done.stderr.splitlines() if " WARN" in line or " ERROR" in line]
    if done.returncode or (quiet and complaints):
        words = " ".join(f"{done.stdout[-2000:]} {done.stderr[-2000:]}".split())
        raise ProofError(f"exit status {done.returncode}: {words}")
    return done.stdout


PROOFS = {"foxglove": foxglove, "pymcap-cli": doctor, "rerun": rerun, "view": view}


if __name__ == "__main__":
    main([Path(argument) for argument in sys.argv[1:]])
