"""A recovery takes the first gait of an earlier run with the same options, and all else follows."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from selfmodel.cli import recover
from selfmodel.cli.commands import Recover
from selfmodel.cli.recover import experiment_of
from selfmodel.logs.controllers import save_controller
from selfmodel.logs.repertoires import save_repertoire
from selfmodel.recovery.candidates import CandidateController
from selfmodel.recovery.recover import evolved
from selfmodel.recovery.result import Event, Recovery
from selfmodel.robot.robot import Robot
from selfmodel.studies.experiment import run
from tests.helpers.drivers import random_controllers, random_repertoire

TINY = {"case": 1, "kinds": "paper", "population": 4, "generations": 1, "steps": 60, "trials": 1}


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's cache, in which gaits of any search are kept."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(recover, "WORTH_KEEPING", 0)
    return tmp_path / "cache" / "selfmodel" / "gaits"


def recovered(folder: Path, **options: object) -> tuple[Recovery, list[str]]:
    """A small recovery of the options, and its events."""
    events: list[str] = []

    def on_event(event: Event) -> None:
        events.append(str(event))

    given = Recover(robot="quadruped", out=folder, **{**TINY, **options})
    return run(experiment_of(given), on_event).recovery, events


def test_the_second_run_evolves_no_first_gait_and_differs_in_nothing_else(
    tmp_path: Path, cache: Path, capsys: pytest.CaptureFixture[str]
):
    first, _ = recovered(tmp_path / "first")
    (kept,) = cache.glob("*.npz")
    assert "earlier run" not in capsys.readouterr().err
    second, events = recovered(tmp_path / "second")

    assert f"{kept}; --no-cache evolves it again" in capsys.readouterr().err
    assert not any(event.startswith("repair for intact") for event in events)
    assert second.repair_evaluations < first.repair_evaluations
    assert second.scores == first.scores
    assert (second.predicted, second.robust_means) == (first.predicted, first.robust_means)
    assert np.isfinite(second.robust_means[0])
    assert str(second.diagnosis) == str(first.diagnosis)


@pytest.mark.parametrize(
    "other",
    [
        {"seed": 1},
        {"score": "displacement"},
        {"controller": "cpg"},
        {"generations": 2},
        {"steps": 61},
        {"repair_population": 6},
        {"search": "ea"},
        {"repair": "paper"},
        {"robot": "hexapod"},
    ],
)
def test_what_changes_a_gait_is_another_one(cache: Path, other: dict[str, object]):
    assert path_of({}) != path_of(other)
    assert path_of({}).parent == path_of(other).parent == cache


@pytest.mark.parametrize(
    "same",
    [{"case": 2}, {"gap": 0.1}, {"trials": 2}, {"threads": 1}, {"genes": 1}, {"kinds": "all"}],
)
def test_what_comes_after_the_gait_leaves_it(same: dict[str, object]):
    assert path_of({}) == path_of(same)


def path_of(options: dict[str, object]) -> Path:
    """The file of the first gait of some options."""
    return keeps({**options}).args[0]


def keeps(options: dict[str, object]) -> Callable[..., CandidateController]:
    return experiment_of(Recover(**{"robot": "quadruped", **TINY, **options})).first_gait


@pytest.mark.parametrize(
    "other",
    [
        {"cache": False},
        {"max_joint_speed": 9.0},
        {"max_joint_torque": 9.0},
        {"max_self_collision": 0.1},
        {"score": "selfmodel.recovery.scores:UPRIGHT"},
        {"score": "tracking"},
        {"controller": "gait.npz"},
        {"repertoire": Path("gaits.npz")},
    ],
)
def test_no_gait_is_kept_that_a_digest_does_not_tell_or_a_user_does_not_want(
    quadruped: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, other: dict[str, object]
):
    monkeypatch.chdir(tmp_path)
    save_controller(Path("gait.npz"), random_controllers(quadruped, 1)[0])
    save_repertoire(Path("gaits.npz"), random_repertoire(quadruped))
    assert keeps(other) is evolved


def test_no_gait_is_kept_of_a_small_search_or_of_a_self_model_that_flatters(
    quadruped: Robot, cache: Path, monkeypatch: pytest.MonkeyPatch
):
    found = CandidateController(random_controllers(quadruped, 1)[0], scores=np.ones(2))
    keep = keeps({})

    assert keep(lambda: dataclasses.replace(found, parts=4)).parts == 4
    assert not cache.exists()
    monkeypatch.setattr(recover, "WORTH_KEEPING", 10**6)
    assert keeps({}) is evolved
    assert keeps({"population": 100, "generations": 30, "steps": 1000}) is not evolved


@pytest.mark.parametrize("reason", ["a file", "no home", "relative"])
def test_a_cache_that_is_not_writable_costs_a_note_at_most(
    quadruped: Robot,
    cache: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    reason: str,
):
    (gait,) = random_controllers(quadruped, 1)
    if reason == "a file":
        cache.parent.parent.write_text("a file")
        assert keeps({})(lambda: CandidateController(gait, np.ones(1))).controller == gait
        assert f"{cache} is not writable" in capsys.readouterr().err
        return
    monkeypatch.setenv("XDG_CACHE_HOME", "" if reason == "no home" else "here")
    monkeypatch.setattr(Path, "home", no_home)
    assert keeps({}) is evolved


def no_home() -> Path:
    raise RuntimeError("Could not determine home directory.")


@pytest.mark.parametrize("damage", [b"", b"PK", bytes(2**25)])
def test_a_damaged_gait_is_evolved_again_and_replaced(
    quadruped: Robot, cache: Path, capsys: pytest.CaptureFixture[str], damage: bytes
):
    path = path_of({})
    cache.mkdir(parents=True)
    path.write_bytes(damage)
    (gait,) = random_controllers(quadruped, 1)
    keep = keeps({})

    assert str(path) in capsys.readouterr().err
    assert keep(lambda: CandidateController(gait, np.ones(1))).controller == gait
    assert keeps({})(None).controller == gait
