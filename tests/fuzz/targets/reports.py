"""Folders of which reports are made: progress of searches, and tables of campaigns."""

import json
from pathlib import Path

import numpy as np

from selfmodel.report.campaign import report_of_campaign
from selfmodel.report.document import as_json
from selfmodel.report.progress import SEARCHES, read_searches
from tests.fuzz.mutate import data as raw, jsons
from tests.fuzz.target import Case, Make, Target

PROGRESS = [{"kind": "repair", "hypothesis": "intact", "best": [0.1, None], "evaluations": [8, 16]}]
RESULTS = {"rows": [{"a": 1}], "scores": [{"runs": 3, "time": {"low": 1.0, "high": None}}]}
TABLE = b"robot,gap,correct,distance\nquadruped,0.1,true,1e-3\nhexapod,0.2,false,\n"
LINES = b'{"cell": 1, "correct": true, "best": [1.5, 2]}\n{"cell": 2, "correct": false}\n'


def prepare(folder: Path) -> Make:  # noqa: ARG001  # its seeds are here
    """Returns the maker of folders."""

    def make(rng: np.random.Generator) -> Case:
        kind = rng.random()
        if kind < 0.3:
            data, what = jsons.mutated(json.dumps(PROGRESS).encode(), rng)
            return Case(f"searches {what}", {SEARCHES: data}, _check_searches)
        files = {"results.csv": TABLE, "results.json": json.dumps(RESULTS).encode()}
        if kind < 0.6:
            files["results.json"], what = jsons.mutated(files["results.json"], rng)
        elif kind < 0.8:
            files["results.csv"], what = raw.mutated(TABLE, rng)
        else:
            lines, what = raw.mutated(LINES, rng)
            files = {"cells.jsonl": lines}  # without a CSV file, the shares are those of the lines
        return Case(f"campaign {what}", files, _check_campaign)

    return make


def _check_searches() -> str:
    return f"read {len(read_searches(Path())) > 0}"


def _check_campaign() -> str:
    json.dumps(as_json(report_of_campaign(Path())), allow_nan=False)
    return "read"


TARGET = Target("reports", 4, prepare)
