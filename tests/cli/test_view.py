"""``selfmodel view``: a log in Rerun, with its simulation, and how to open it in Foxglove."""

import json
from pathlib import Path

import pytest

from tests.helpers.command import selfmodel

pytest.importorskip("rerun", reason="the extra rerun is not installed")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a short log."""
    folder = tmp_path_factory.mktemp("view")
    done = selfmodel("trial", "quadruped", "--steps", "20", "--out", "a.mcap", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder


def test_a_file_is_written_and_foxglove_is_told(folder: Path):
    told = selfmodel("view", "a.mcap", "-o", "a.rrd", cwd=folder)

    assert told.returncode == 0, told.stderr
    assert "a.rrd: quadruped as logged, and simulated as intact, transparent" in told.stdout
    assert "In Foxglove or Lichtblick: open the local file a.mcap" in told.stdout
    assert (folder / "a.rrd").stat().st_size > 10_000


def test_the_facts_are_one_json_object(folder: Path):
    hypothesis = "break:front_left_knee"
    told = selfmodel(
        *("view", "a.mcap", "--hypothesis", hypothesis, "-o", "b.rrd", "--json"), cwd=folder
    )
    found = json.loads(told.stdout)

    assert found["hypothesis"] == hypothesis
    assert found["bytes"] == (folder / "b.rrd").stat().st_size
    assert Path(found["foxglove_layout"]).is_file()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("-o", "a.mp4"), "--out needs a name that ends in .rrd"),
        (("-o", "missing/a.rrd"), "there is no folder missing"),
        (("-o", "taken.rrd"), "taken.rrd exists, and is not overwritten"),
        (("-o", "c.rrd", "--hypothesis", "break:nose"), "'nose'"),
    ],
)
def test_a_wrong_request_is_an_error_before_any_work(
    folder: Path, arguments: tuple[str, ...], message: str
):
    (folder / "taken.rrd").touch()
    told = selfmodel("view", "a.mcap", *arguments, cwd=folder)

    assert told.returncode == 2
    assert message in told.stderr
    assert (folder / "taken.rrd").read_bytes() == b""
