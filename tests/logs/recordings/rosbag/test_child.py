"""A bag takes no more memory and time than the budget, in this process and in its child."""

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from selfmodel.logs.errors import CorruptError
from selfmodel.logs.recordings.rosbag.bag import read_bag
from selfmodel.logs.recordings.rosbag.gathering import LONGEST_NAME
from selfmodel.sandbox.budget import Budget, BudgetError
from tests.logs.conftest import MJCF
from tests.logs.recordings.conftest import MAPPING, recorded
from tests.logs.recordings.rosbag import hostile
from tests.logs.recordings.rosbag.bags import T0, array, joint_state, write_bag

SMALL = Budget(memory=10**8, time=36)
"""100 MB, and 2 s of processor time for a file."""


MEASURED = """
import resource, subprocess, sys

status = subprocess.call(sys.argv[1:], stdout=subprocess.DEVNULL)
usage = resource.getrusage(resource.RUSAGE_CHILDREN)
print(status, usage.ru_maxrss, usage.ru_utime + usage.ru_stime)
"""
"""A small process starts the command: the memory of a new process is at least that of its parent,
and a process of many tests may have more than the limit."""


def cost(*command: str | Path) -> tuple[int, str, int, float]:
    """Exit status, standard error, and most memory (bytes) and time (s) of a process.

    Those of its child processes are included.
    """
    done = subprocess.run(
        [sys.executable, "-c", MEASURED, *command], capture_output=True, text=True, check=True
    )
    status, memory, seconds = done.stdout.split()
    unit = 1 if sys.platform == "darwin" else 1024
    return int(status), done.stderr, int(memory) * unit, float(seconds)


@pytest.mark.process
@pytest.mark.parametrize(
    ("attack", "sentence"),
    [
        (hostile.many_numbers, "more than 10000 names.* --budget memory="),
        (hostile.many_messages, "--budget (memory|time)="),
        (hostile.generated_column, "messages has computed rows"),
        (hostile.endless_view, "messages has computed rows"),
        (hostile.packed_file, "unpacks to more than 375000000 bytes: .*--budget memory="),
    ],
)
def test_an_import_ends_within_the_budget(
    attack: Callable[[Path], Path], sentence: str, tmp_path: Path
):
    bag = attack(tmp_path)
    assert bag.stat().st_size < 50_000
    (tmp_path / "biped.xml").write_text(MJCF)
    (tmp_path / "map.toml").write_text(MAPPING)

    status, errors, memory, seconds = cost(
        *(sys.executable, "-m", "selfmodel", "logs", "import", bag),
        *("--mapping", tmp_path / "map.toml", "-o", tmp_path / "trial.mcap"),
    )

    assert status in (1, 2)
    assert re.fullmatch(rf"error: .*{bag.name}.*({sentence}).*\n", errors)
    assert memory < 1.2e9
    assert seconds < 15
    assert not (tmp_path / "trial.mcap").exists()


def test_a_bag_of_many_names_is_refused(tmp_path: Path):
    names = [f"joint_{k}" for k in range(SMALL.names + 1)]
    items = [("/joints", T0, joint_state(T0, names, [0.0] * len(names)))]
    bag = write_bag(tmp_path / "bag", items)

    with pytest.raises(BudgetError, match="more than 1000 names, those in the messages on /joints"):
        read_bag(bag, ["/joints"], SMALL)
    assert read_bag(bag, ["/joints"]).series["/joints"].columns.keys() == set(names)
    assert read_bag(bag, [], SMALL).series == {}


def test_a_bag_of_many_topics_is_refused(tmp_path: Path):
    bag = write_bag(
        tmp_path / "bag", [(f"/x{k}", T0, array([0.0])) for k in range(Budget(10**7).names + 1)]
    )

    with pytest.raises(BudgetError, match="more than 100 names, those of topics included"):
        read_bag(bag, [], Budget(memory=10**7))
    assert len(read_bag(bag, []).topics) == 101


def test_a_bag_of_many_numbers_is_refused(tmp_path: Path):
    budget = Budget(memory=5 * 10**7)
    width = budget.names // 2
    messages = budget.file_bytes // 8 // (width + 2)
    items = [("/x", T0 + k, array([0.0] * width)) for k in range(messages)]
    most = write_bag(tmp_path / "most", items)
    more = write_bag(tmp_path / "more", [*items, *items[:5]])

    assert len(read_bag(most, ["/x"], budget).series["/x"].columns) == width
    with pytest.raises(BudgetError, match=r"numbers on the topics of the mapping.*--budget memory"):
        read_bag(more, ["/x"], budget)


def test_a_name_without_end_is_refused(tmp_path: Path):
    name = "x" * (LONGEST_NAME + 1)
    bag = write_bag(tmp_path / "bag", [("/joints", T0, joint_state(T0, [name], [0.0]))])

    with pytest.raises(CorruptError, match="a name in the messages on /joints has more than 1000"):
        read_bag(bag, ["/joints"])


def test_a_bag_is_read_from_the_present_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folder = write_bag(tmp_path / "bag", recorded(0.05))
    absolute = read_bag(folder, [])
    monkeypatch.chdir(tmp_path)

    assert read_bag(Path("bag"), []).sources == absolute.sources
