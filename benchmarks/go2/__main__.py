"""Calibration and diagnosis of a real robot: a Unitree Go2 on a stand, from 15 s of its log.

Fits the model to the first 10 s, compares predictions of the last 5 s, fits three disjoint thirds,
diagnoses the last 5 s, and puts weak motors into them; then the last two again with the times
exchanged: the fit to the last 10 s, and the first 5 s diagnosed. Each stage adds its numbers to the
JSON.

    python -m benchmarks.go2 --out benchmarks/go2/go2.json --figure docs/figures/go2.png
"""

import argparse
import json
from pathlib import Path
from time import perf_counter, process_time
from typing import TYPE_CHECKING, Any

from benchmarks.go2 import study
from benchmarks.go2.figure import draw
from benchmarks.go2.sample import robot_on_stand
from benchmarks.go2.study import ALL, FITTED

if TYPE_CHECKING:
    from collections.abc import Callable

STAGES = ("fit", "thirds", "hypotheses", "verdict", "injected", "exchanged")


def main() -> None:
    """Runs the stages, in their order; a stage after ``fit`` reads its fit from the JSON."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.go2", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="JSON file, read and written")
    parser.add_argument("--figure", type=Path, help="PNG file of the held-out part")
    parser.add_argument("--stages", default=",".join(STAGES))
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    found = json.loads(options.out.read_text()) if options.out.exists() else {}
    nominal = robot_on_stand()
    stages: dict[str, Callable[[], Any]] = {
        "fit": lambda: study.fit_to(nominal, 0, FITTED, options.threads),
        "thirds": lambda: [
            study.fit_to(nominal, k * ALL // 3, (k + 1) * ALL // 3, options.threads)
            for k in range(3)
        ],
        "hypotheses": lambda: {
            "nominal": study.better_hypotheses(nominal, options.threads),
            "calibrated": study.better_hypotheses(
                study.robot_of(nominal, found["fit"]), options.threads
            ),
        },
        "verdict": lambda: study.verdict_of(
            study.robot_of(nominal, found["fit"]), (0, FITTED), (FITTED, ALL), options.threads
        ),
        "injected": lambda: study.injected_faults(
            study.robot_of(nominal, found["fit"]),
            (FITTED, ALL),
            found["verdict"]["detectable"],
            options.threads,
        ),
        "exchanged": lambda: study.exchanged_parts(nominal, options.threads),
    }
    for stage in options.stages.split(","):
        start = perf_counter(), process_time()
        found[stage] = stages[stage]()
        found.setdefault("seconds", {})[stage] = {
            "wall": round(perf_counter() - start[0], 1),
            "processor": round(process_time() - start[1], 1),
        }
        options.out.write_text(json.dumps(found, indent=1) + "\n")
    found["rms"] = study.rms_errors(nominal, study.robot_of(nominal, found["fit"]))
    options.out.write_text(json.dumps(found, indent=1) + "\n")
    if options.figure:
        draw(nominal, study.robot_of(nominal, found["fit"]), options.figure)


if __name__ == "__main__":
    main()
