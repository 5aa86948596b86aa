"""``make results``: Table I of the paper on both robots, with the rate of right diagnoses.

Every run has its own folder and is repeated only if the robot, the settings or the version changed.
Each uses one thread, and as many run at once as there are processors. Cost: a gait takes about
15 s (quadruped) or 30 s (hexapod), the rest of a recovery three to four times that; it is
proportional to seeds, cases, population, generations and steps.
"""

import argparse
import dataclasses
import hashlib
import json
import multiprocessing
import os
import shutil
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from time import perf_counter

import numpy as np

from benchmarks.results import Facts, write_results
from benchmarks.walking import walk
from selfmodel.cli.output.report import facts
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.experiments.arguments import comparator_choice
from selfmodel.experiments.experiment import Experiment, run
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.logs import load_controller, save_controller
from selfmodel.recovery.repair import RepairSearch
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.tasks import ROBOTS
from selfmodel.version import __version__

SEEDS = range(10)
TOLD_APART_BY_WAY = (1, 2, 3, 5, 6, 9)
"""Cases that displacement alone should diagnose; they have a run per seed."""


def main() -> None:
    """Runs the missing runs and writes docs/results/table-one.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("runs/table_one"))
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    options = parser.parse_args()
    gaits = [(robot, seed, options.out) for robot in ROBOTS for seed in SEEDS]
    cells = [(robot, case, 0, options.out) for robot in ROBOTS for case in range(1, 11)]
    cells += [
        ("quadruped", case, seed, options.out)
        for seed in SEEDS
        if seed
        for case in TOLD_APART_BY_WAY
    ]
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(options.workers, mp_context=context) as pool:
        walks = list(pool.map(evolve_gait, *zip(*gaits, strict=True)))
        runs = list(pool.map(recover_once, *zip(*cells, strict=True)))
    write_results(walks, runs)


def evolve_gait(name: str, seed: int, out: Path) -> Facts:
    """Evolves the first gait of a recovery with this seed, and returns measures of its walk."""
    folder = out / "gaits" / f"{name}-seed{seed}"
    facts_file = folder / "facts.json"
    start, settings = perf_counter(), Settings()
    robot = ROBOTS[name].robot()
    if not _is_made(facts_file, robot):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        # The first of the streams that `recover` draws from: the same gait as its own.
        (stream,) = np.random.default_rng(seed).spawn(1)
        repair = RepairSearch(Simulator(robot, threads=1), settings)
        gait = repair.best(INTACT, [], stream, lambda _: None)
        seconds = perf_counter() - start
        save_controller(folder / "gait.npz", gait)
        walked = walk(robot, gait, settings.steps)
        found = {
            "made_of": _made_of(robot),
            "robot": name,
            "seed": seed,
            "seconds": seconds,
            "walking": walked.is_walking,
            **dataclasses.asdict(walked),
        }
        facts_file.write_text(json.dumps(found, indent=2), encoding="utf-8")
        print(found, flush=True)
    return _read(facts_file)


def recover_once(name: str, case: int, seed: int, out: Path) -> Facts:
    """Recovers a robot from one case, starting with the gait of its seed."""
    folder = out / f"{name}-case{case:02d}-seed{seed}"
    facts_file = folder.with_suffix(".json")
    robot = ROBOTS[name].robot()
    if not _is_made(facts_file, robot):
        shutil.rmtree(folder, ignore_errors=True)
        experiment = Experiment(
            robot=robot,
            case=case,
            truth=parse(ROBOTS[name].cases[case], robot.anatomy),
            choose_comparator=comparator_choice(FORWARD_DISPLACEMENT),
            kinds=PAPER_KINDS,
            settings=Settings(),
            seed=seed,
            threads=1,
            folder=folder,
            gait=load_controller(out / "gaits" / f"{name}-seed{seed}" / "gait.npz"),
        )
        found = {
            "made_of": _made_of(robot),
            **facts(experiment, run(experiment, lambda _: None)),
        }
        facts_file.write_text(json.dumps(found, indent=2), encoding="utf-8")
        print(name, case, seed, found["correct"], found["recovery"], found["seconds"], flush=True)
    return _read(facts_file)


def _made_of(robot: Robot) -> str:
    """Returns the digest of everything that a result depends on."""
    settings = json.dumps(dataclasses.asdict(Settings()))
    return hashlib.sha256(f"{__version__} {settings} {robot.mjcf}".encode()).hexdigest()


def _is_made(file: Path, robot: Robot) -> bool:
    return file.exists() and _read(file).get("made_of") == _made_of(robot)


def _read(file: Path) -> Facts:
    found: Facts = json.loads(file.read_text(encoding="utf-8"))
    return found


if __name__ == "__main__":
    main()
