"""Promises of trainings: they learn, go on to the bit, and write policies that others read."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dm_control import suite

import selfmodel
from selfmodel.arguments import read_controller
from selfmodel.controllers.controller import Controller
from selfmodel.errors import InputError
from selfmodel.studies import plans, training
from selfmodel.studies.training import Training, TrainingSettings, evolve_policy

SMALL = TrainingSettings(pairs=3, steps=20, seed=4)
HOPPER, CHEETAH = "suite-hopper-stand", "suite-cheetah-run"


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "EPISODE", 30)


def numbers(folder: Path) -> dict[str, np.ndarray]:
    with np.load(folder / training.STATE) as file:
        return {name: file[name] for name in ("mean", "moments", "count", "average", "square")}


def test_a_training_that_goes_on_has_the_bits_of_a_whole_one(tmp_path: Path):
    settings = TrainingSettings(hidden=3, pairs=3, steps=30, seed=4)
    whole = evolve_policy(HOPPER, tmp_path / "a", settings, generations=4, threads=2)
    evolve_policy(HOPPER, tmp_path / "b", settings, generations=2, threads=1)
    parts = evolve_policy(HOPPER, tmp_path / "b", settings, generations=4, threads=1)

    for name, values in numbers(tmp_path / "a").items():
        np.testing.assert_array_equal(numbers(tmp_path / "b")[name], values, err_msg=name)
    assert parts.policy == whole.policy
    one, other = ([(*row[:2], *row[3:]) for row in each.rows] for each in (whole, parts))
    assert one == other
    assert [row[:2] for row in one] == [(k, 6 * 30 * k) for k in (1, 2, 3, 4)]
    lines = (tmp_path / "b" / training.PROGRESS).read_text().splitlines()
    assert [line.split(",")[0] for line in lines] == ["generation", "1", "2", "3", "4"]


def test_a_policy_may_be_evolved_for_a_damaged_body(tmp_path: Path):
    jammed = replace(SMALL, damage="jam:knee")
    for name, settings in (("intact", SMALL), ("jammed", jammed)):
        evolve_policy(HOPPER, tmp_path / name, settings, generations=1, threads=1)
    moved, stuck = (numbers(tmp_path / name)["square"] for name in ("intact", "jammed"))

    assert moved.max() > 0
    assert not np.array_equal(moved, stuck)
    with pytest.raises(InputError, match="another damage: give its options"):
        evolve_policy(HOPPER, tmp_path / "jammed", SMALL, generations=2, threads=1)
    for wrong, reason in (("jam:hand", "hand"), ("sensor:knee_angle", "no effect")):
        with pytest.raises(InputError, match=reason):
            Training(HOPPER, replace(SMALL, damage=wrong))


def test_a_folder_of_another_training_is_refused(tmp_path: Path):
    evolve_policy(HOPPER, tmp_path, SMALL, generations=1, threads=1)
    other = TrainingSettings(hidden=2, pairs=3, steps=20, seed=5)
    with pytest.raises(InputError, match="of a training with another neurons, seed: give its opt"):
        evolve_policy(HOPPER, tmp_path, other, generations=2, threads=1)
    (tmp_path / training.STATE).write_bytes(b"PK")
    with pytest.raises(InputError, match=r"state.npz: expected the state of a training"):
        evolve_policy(HOPPER, tmp_path, SMALL, generations=2, threads=1)


def test_episodes_of_the_search_may_be_shorter_than_those_of_the_task():
    seeds = np.array([5, 6])
    short = Training("suite-walker-walk", SMALL)
    own = [Controller(short.policy, np.zeros(0))] * 2
    assert (short.returns(own, seeds, 20) < short.returns(own, seeds)).all()
    short.run(1)
    assert short.rows[0][1] == 6 * 20
    assert short.rows[0][3] <= short.rows[0][4] <= training.EPISODE


@pytest.mark.parametrize("body", ["quadruped", "suite-dog-walk", "suite-walker-wlak"])
def test_a_task_without_reward_or_observation_is_refused(body: str):
    with pytest.raises(InputError, match=f"unknown task that policies are evolved for '{body}'"):
        Training(body, SMALL)


@pytest.mark.search
def test_a_training_learns():
    own = Training(CHEETAH, TrainingSettings(pairs=8, steps=100, seed=1))
    own.run(12)
    means = [row[3] for row in own.rows]
    assert np.mean(means[-3:]) > 2 * np.mean(means[:3])


def test_the_policy_file_has_the_return_that_the_training_judged_in_dm_controls_own_task(
    tmp_path: Path,
):
    seeds = np.array([11, 12])
    own = evolve_policy(CHEETAH, tmp_path, SMALL, generations=2, threads=1)
    controller = read_controller(tmp_path / training.POLICY, selfmodel.load_robot(CHEETAH))
    judged = own.returns([controller] * 2, seeds)
    found = []
    for seed in seeds:
        env = suite.load("cheetah", "run", {"random": np.random.RandomState(seed)})
        (episode,) = selfmodel.evaluate(env, controller, robot=CHEETAH, steps=31, score="return")
        found.append(episode.episode_return)

    assert controller.design == own.policy
    np.testing.assert_allclose(judged, found, rtol=1e-6)
    assert own.judged(3).shape == (3,)


def test_observations_are_normalised_by_their_moments():
    rng = np.random.default_rng(0)
    rows = rng.normal((1.0, -50.0), (0.5, 20.0), (90, 2))
    own = training.Moments(0.0, np.zeros(2), np.ones(2))
    for part in np.split(rows, 3):
        shifted = part - own.mean
        own.add(len(part), shifted.sum(axis=0), (shifted**2).sum(axis=0))
    np.testing.assert_allclose(own.mean, rows.mean(axis=0))
    np.testing.assert_allclose(own.spread, rows.std(axis=0))


@pytest.mark.search
def test_a_study_recovers_bodies_around_the_controller_of_a_file(tmp_path: Path):
    evolve_policy(HOPPER, tmp_path, SMALL, generations=1, threads=1)
    given = {"bodies": HOPPER, "cases": (), "damages": "jam:knee", "score": "return"}
    small = selfmodel.Settings(steps=60, trials=1, generations=2).scaled(4)
    policy = tmp_path / training.POLICY
    study = plans.suite(tmp_path / "study", **given, settings=small, controller=policy)
    (cell,) = study.cells()
    assert cell.parameters["shared"]["repair"] == "compensate"
    assert not study.run()
    (row,) = study.rows("recoveries")
    assert (row["repair"], row["score"], row["return_most"]) == ("compensate", "return", 59)
    assert row["before"] == row["return_before"]

    with pytest.raises(InputError, match="repair robust evolves the weights"):
        plans.suite(tmp_path / "no", **given, controller=policy, repair="robust")
    with pytest.raises(InputError, match=r"needs a policy, .*: give compensate, or .*FILE"):
        plans.suite(tmp_path / "no", **given, repair="finetune")


@pytest.mark.search
def test_a_study_recovers_around_the_gaits_that_it_evolves(tmp_path: Path):
    given = {"bodies": HOPPER, "cases": (), "damages": "jam:knee", "controller": "cpg"}
    small = selfmodel.Settings(steps=60, trials=1, generations=2).scaled(4)
    around, robust = (
        plans.suite(tmp_path / name, **given, settings=small, repair=name)
        for name in ("compensate", "robust")
    )
    assert not around.run()
    (row,) = around.rows("recoveries")
    assert row["repair"] == "compensate"
    gaits = [study.cells()[0].needs["gait"].parameters for study in (around, robust)]
    assert gaits[0] == gaits[1], "the same gait, evolved by the robust repair"
