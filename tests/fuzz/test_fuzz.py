"""No input of any reader leads to anything but a declared error; and the campaign can fail."""

import gc
import os
import signal
import struct
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from mcap.records import Message as McapMessage

from selfmodel.errors import InputError
from selfmodel.logs import LogError, read_log
from selfmodel.sandbox.budget import Budget
from selfmodel.sandbox.isolation import run_isolated
from selfmodel.sandbox.message import Message
from tests.fuzz import oracle
from tests.fuzz.campaign import Plan, run, work_folder
from tests.fuzz.mcap_file import McapFile, read_file, replaced, written
from tests.fuzz.seal import BASE, first_float, seal
from tests.fuzz.seeds import biped, trial_log
from tests.fuzz.tally import Tally
from tests.fuzz.target import Case, Target
from tests.fuzz.targets import TARGETS

pytestmark = pytest.mark.process  # each campaign forks


def campaign(folder: Path, target: Target, count: int, processes: int = 1) -> Tally:
    """Runs a small campaign; its findings are in the folder ``failures``."""
    plan = Plan([target], 0, 0, count, 600.0, processes, folder / "failures")
    with work_folder() as work:
        return run(plan, work, lambda *_: None)[target.name]


def reports(folder: Path) -> str:
    return "\n".join(path.read_text() for path in sorted(folder.rglob("report.txt")))


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("damaged-logs", 60),
        *(pytest.param(name, 80, marks=pytest.mark.fuzz) for name in TARGETS),
        pytest.param("damaged-logs", 1_000, marks=pytest.mark.fuzz),
    ],
)
def test_no_input_leads_to_anything_but_a_declared_error(name: str, count: int, tmp_path: Path):
    tally = campaign(tmp_path, TARGETS[name], count, processes=2)

    assert not tally.findings, reports(tmp_path)
    assert tally.cases == count
    assert any("Error" not in outcome for outcome in tally.outcomes), "none was accepted"


def failing(check: Callable[[], str]) -> Target:
    """A target whose case 3 of a batch of 5 has a check of its own; the others pass."""
    numbers = iter(range(5))

    def make(_: np.random.Generator) -> Case:
        bad = next(numbers) == 3
        return Case("made", {"input": b"x"}, check if bad else lambda: "fine")

    return Target("failing", 1, lambda _: make)


def _raise() -> str:
    raise KeyError("x")


def _refuse_without_a_word() -> str:
    raise InputError("")


def _print() -> str:
    print("RuntimeWarning", file=sys.stderr)  # noqa: T201  # it is a finding
    return "fine"


def _leave() -> str:
    Path("MUJOCO_LOG.TXT").touch()
    return "fine"


def _leave_part() -> str:
    Path("log.mcap.part").touch()
    return "fine"


def _change() -> str:
    Path("input").write_bytes(b"y")
    return "fine"


def _fill() -> str:
    return "fine" if np.ones(20_000_000).any() else ""


def _collect_and_fill() -> str:
    gc.collect()
    return _fill()


def _spin() -> str:
    while time.process_time() < 1e6:
        pass
    return "fine"


def _run(task: str, *, allowed: tuple[type[Exception], ...] = (), **facts: object) -> str:
    with suppress(*allowed):
        run_isolated(
            f"tests.helpers.isolated_tasks:{task}", Message(facts), what="x", budget=Budget(time=18)
        )
    return "fine"


def _crash() -> str:
    os.kill(os.getpid(), signal.SIGSEGV)
    return "fine"


@pytest.mark.parametrize(
    ("check", "reported"),
    [
        (_raise, "KeyError: 'x'"),
        (_refuse_without_a_word, "InputError"),
        (_print, "printed:\nRuntimeWarning"),
        (_leave, "files left or changed: MUJOCO_LOG.TXT"),
        (_change, "files left or changed: input"),
        (_fill, "took "),
        (_spin, "its process ended with SIGPROF"),
        (_crash, "its process ended with SIGSEGV"),
        pytest.param(
            partial(_run, "fail", allowed=(RuntimeError,)), "ZeroDivisionError", id="fail"
        ),
        pytest.param(
            partial(_run, "crash"), "a child process ended with SIGSEGV", id="crash in a child"
        ),
        pytest.param(partial(_run, "allocate", bytes=4 * 10**7), "took ", id="memory of a child"),
        pytest.param(partial(_run, "loop"), " s\n", id="time of a child"),
    ],
)
def test_a_finding_is_reported_with_its_command_and_ends_no_campaign(
    check: Callable[[], str], reported: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)  # a case that is killed leaves its folder as the working folder
    monkeypatch.setattr(oracle, "SECONDS", 0.6)
    monkeypatch.setattr(oracle, "MARGIN", 0.0)
    monkeypatch.setattr(oracle, "MEGABYTES", 20)

    tally = campaign(tmp_path, failing(check), 5)

    assert (tally.outcomes.total(), tally.findings.total()) == (4, 1)
    report = reports(tmp_path)
    assert "python -m tests.fuzz --only failing --seed 0 --first " in report
    assert reported in report


def test_garbage_from_before_a_campaign_hides_no_memory_of_a_case(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(oracle, "MEGABYTES", 20)
    garbage: list[object] = [np.ones(20_000_000)]
    garbage.append(garbage)  # a cycle, which only a collection frees
    gc.collect()  # moves it to the oldest generation, so that none collects it before the case
    del garbage

    assert campaign(tmp_path, failing(_collect_and_fill), 5).findings.total() == 1


def test_a_part_file_may_be_left(tmp_path: Path):
    assert not campaign(tmp_path, failing(_leave_part), 5).findings


def test_equal_seeds_make_equal_cases(tmp_path: Path):
    make = TARGETS["sealed-logs"].prepare(tmp_path)

    first, again, other = (make(np.random.default_rng(seed)) for seed in (1, 1, 2))

    assert (first.what, first.files) == (again.what, again.files)
    assert first.files != other.files


@pytest.mark.parametrize("clock", [False, True])
def test_a_sealed_log_passes_every_check_of_damage(tmp_path: Path, *, clock: bool):
    path = trial_log(tmp_path / "trial.mcap", biped(), 6, clock=clock)
    whole, file = read_log(path), read_file(path.read_bytes())
    last = max(index for index, item in enumerate(file.items) if _is_position(file, item))
    payload = bytearray(file.items[last].data)
    payload[first_float(payload) : first_float(payload) + 8] = struct.pack("<d", 7.0)
    file.items[last] = replaced(file.items[last], data=bytes(payload))

    path.write_bytes(written(file))
    with pytest.raises(LogError):
        read_log(path)
    seal(file)
    path.write_bytes(written(file))
    read = read_log(path)

    assert read.trial.behaviour["base_position"][-1, 0] == 7.0
    assert read.trial.plan == whole.trial.plan


def _is_position(file: McapFile, item: object) -> bool:
    return isinstance(item, McapMessage) and file.channels[item.channel_id].topic == BASE
