"""A study of 200 cells that is killed, whose plug-in is edited, and that Dask then continues.

    python -m benchmarks.edited_plug_in NEW_FOLDER

It prints the numbers as JSON, and fails unless exactly the cells of the edited plug-in and the
unfinished ones were computed again, with the table of an uninterrupted study; 5 min of CPU time.
"""

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
from distributed import LocalCluster

from selfmodel.studies.study import rows_in

ROOT = Path(__file__).parents[1]

COMPARATORS = (
    "forward-displacement,paper-sensors,sensor-series,gait-pattern,segment-prediction,"
    "segment-prediction-onboard,edited:EDITED,heading_comparator:HEADING"
)
OPTIONS = f"""ablate --robots quadruped --case 1,2,3,4,5,6,7,8,9
--damage break:back_right_knee,jam:back_left_knee --kinds paper --gap 0,0.1 --seeds 1
--comparator {COMPARATORS} --bank {ROOT}/benchmarks/bank
--steps 50 --trials 1 --population 4 --generations 1 --workers 2""".split()
CELLS = 200
"""2 gaits, 22 runs with their trials, and 8 diagnoses of each."""

EDITED = """
from beside import USED

class Edited:
    name = "edited"

    def prepare(self, trial):
        return USED.prepare(trial)

EDITED = Edited()
"""
BESIDE = "from selfmodel.comparators import {} as USED\n"
"""What is edited: a module beside that of the comparator."""


def main() -> None:
    """Runs the study three times, and compares."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.edited_plug_in")
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder.resolve()
    folder.mkdir()
    shutil.copy(ROOT / "examples" / "heading_comparator.py", folder)
    (folder / "edited.py").write_text(EDITED)
    (folder / "beside.py").write_text(BESIDE.format("PAPER_SENSORS"))
    os.chdir(folder)  # of the cluster's workers, too
    os.environ["PYTHONPATH"] = str(ROOT)
    study, process = folder / "study", started("study")
    while len(places(study)) < CELLS * 0.55:
        if process.poll() is not None:
            sys.exit(f"the study ended before it was killed: {process.communicate()[1]}")
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    before = places(study)
    (folder / "beside.py").write_text(BESIDE.format("GAIT_PATTERN"))
    with LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=":0"
    ) as cluster:
        told = ended(
            started("study", "--executor", "dask", "--scheduler", cluster.scheduler_address)
        )
    once = ended(started("uninterrupted"))
    computed = set(re.findall(r"^\[\d+/\d+\] (\S+): done", told, re.MULTILINE))
    after, wanted = places(study), places(folder / "uninterrupted")
    edited = {place for place in before if "-edited%3A" in place}
    tables = [table(folder / name) for name in ("study", "uninterrupted")]
    facts = {
        "cells": len(after),
        "finished at the kill": len(before),
        "of these, of the edited plug-in": len(edited),
        "computed by Dask": len(computed),
        "told": [line for line in told.splitlines() if "earlier" in line],
        "names": sorted({row["comparator_name"] for row in rows_in(study, "diagnoses")}),
        "rows": len(tables[0].splitlines()) - 1,
    }
    checks = {
        "the right cells": computed
        == {one.partition("/")[2].rpartition("-")[0] for one in wanted.keys() - before.keys()},
        "the others stayed": all(after.get(one) == before[one] for one in before.keys() - edited),
        "the cells of an uninterrupted study": after.keys() == wanted.keys(),
        "its table": tables[0] == tables[1],
        "nothing told of the uninterrupted one": "earlier" not in once,
    }
    sys.stdout.write(f"{json.dumps(facts | checks, indent=1)}\n")
    sys.exit(0 if all(checks.values()) and edited and len(after) == CELLS else 1)


def started(name: str, *options: str) -> "subprocess.Popen[str]":
    """Starts the study in a process group of its own."""
    command = [sys.executable, "-m", "selfmodel", *OPTIONS, "--out", name, *options]
    return subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def ended(process: "subprocess.Popen[str]") -> str:
    """Returns what a study that ends well tells on standard error."""
    _, told = process.communicate()
    if process.returncode:
        sys.exit(told)
    return told


def places(study: Path) -> dict[str, int]:
    """Returns the folders of the finished cells, and when they were written."""
    files = (
        one for kind in ("gaits", "trials", "runs") for one in study.glob(f"{kind}/*/cell.json")
    )
    return {f"{file.parts[-3]}/{file.parts[-2]}": file.stat().st_mtime_ns for file in files}


def table(study: Path) -> str:
    """Returns the table of a study without the column of times."""
    rows = pd.read_csv(study / "results.csv", dtype=str, keep_default_na=False)
    return str(rows.drop(columns="seconds").to_csv(index=False))


if __name__ == "__main__":
    main()
