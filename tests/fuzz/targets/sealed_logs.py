"""Trial logs with other content, sealed: every checksum and every digest is right.

Such a log may be refused. If it is read, everything that uses a log must work on it, or refuse it.
"""

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

from selfmodel.cli.logs.info import _facts
from selfmodel.comparators import COMPARATORS
from selfmodel.diagnosis.comparator import Comparator
from selfmodel.errors import InputError, WorkError
from selfmodel.experiments import trial_logs
from selfmodel.experiments.arguments import comparator_choice
from selfmodel.experiments.log_diagnosis import set_up_diagnosis
from selfmodel.faults.hypothesis import INTACT
from selfmodel.faults.registry import ALL_KINDS
from selfmodel.logs import LogError, read_gap, read_log, read_truth
from selfmodel.logs.reader import TrialLog
from selfmodel.logs.robots import robot_of
from selfmodel.logs.salvage import salvage
from selfmodel.logs.verify import verify
from selfmodel.sandbox import DEFAULT_BUDGET
from selfmodel.simulation.simulator import Simulator
from selfmodel.simulation.trial_replay import replay
from tests.fuzz.mcap_file import read_file
from tests.fuzz.mutate import records
from tests.fuzz.seal import seal
from tests.fuzz.seeds import DATA, biped, playback_log, trial_log
from tests.fuzz.target import Case, Make, Target

STEPS = 12
NAME = "sealed.mcap"
LOG = Path(NAME)


def prepare(folder: Path) -> Make:
    """Returns the maker of sealed logs."""
    robot = biped()
    paths = [
        trial_log(folder / "trial.mcap", robot, STEPS),
        trial_log(folder / "clock.mcap", robot, STEPS, clock=True),
        playback_log(folder / "playback.mcap", robot, STEPS),
        DATA / "mjcf" / "trial.mcap",
    ]
    every = tuple(COMPARATORS.values())
    files = [read_file(path.read_bytes()) for path in paths]

    def make(rng) -> Case:  # noqa: ANN001  # see Make
        number = int(rng.choice(len(files), p=(0.35, 0.25, 0.25, 0.15)))
        changed, names = records.mutated(files[number], records.LOG, rng)
        seal(changed)
        comparator = every[rng.integers(len(every))]
        what = f"{comparator.name} on {paths[number].name}: {'; '.join(names)}"
        return Case(what, {NAME: records.packed(changed, rng)}, partial(check, comparator))

    return make


def check(comparator: Comparator) -> str:
    """Uses a log in every way."""
    log = read_log(LOG) if _accepted(partial(read_log, LOG)) else None
    facts = _facts(LOG, DEFAULT_BUDGET)
    json.dumps(facts, allow_nan=False)
    _accepted(partial(read_truth, LOG))
    _accepted(partial(read_gap, LOG))
    if log is None:
        if "error" not in facts:
            raise AssertionError("a log that cannot be read has facts")
        return f"{facts['kind']}, {_salvage()}"
    if not _accepted(partial(verify, LOG)):
        return "read"
    robot = robot_of(log)
    _accepted(partial(trial_logs.controller, LOG, robot))
    _replay(log)
    return f"verified, {_diagnosis(comparator)}"


def _accepted(call: Callable[[], object]) -> bool:
    """Returns whether a call ends without a declared error."""
    try:
        call()
    except (InputError, WorkError):
        return False
    return True


def _salvage() -> str:
    out = Path("saved.mcap")
    try:
        salvage(LOG, out)
    except (LogError, InputError):
        return "nothing saved"
    read_log(out)
    verified = _accepted(partial(verify, out))
    out.unlink()
    return "saved" if verified else "saved, model unusable"


def _replay(log: TrialLog) -> None:
    found = replay(log.trial, INTACT, Simulator(robot_of(log), 1))
    json.dumps(found.to_dict(), allow_nan=False)


def _diagnosis(comparator: Comparator) -> str:
    """Sets a diagnosis up, and computes the losses of one hypothesis."""
    try:
        made = set_up_diagnosis(
            [LOG],
            robot=None,
            choose_comparator=comparator_choice(comparator),
            kinds=ALL_KINDS,
            settings=None,
            seed=None,
            calibrate=False,
            threads=1,
        )
        made.search.evidence.distances([INTACT], made.damaged)
    except (InputError, WorkError):
        return "not judged"
    return "judged"


TARGET = Target("sealed-logs", 15, prepare)
