"""Promises of what a study consists of: its robots, failures, gaits, and shares."""

import itertools
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from selfmodel.errors import InputError
from selfmodel.settings import Settings
from selfmodel.studies.plans import ablation, bodies_of, known_cases, paper, suite
from selfmodel.studies.recoveries import ON_ROBOT
from selfmodel.studies.study import Study
from tests.cli.test_studies import BIPED
from tests.robot.mjcf.awkward import CUBE

SMALL = Settings(steps=60, generations=2, trials=2).scaled(6)


def ablated(folder: Path, **changes: object) -> Study:
    usual = {"robots": ["quadruped"], "cases": [1], "comparators": ["forward-displacement"]}
    return ablation(folder, **{**usual, "gaps": [0.0], "seeds": [5], "settings": SMALL, **changes})


def bodies(folder: Path, **changes: object) -> Study:
    usual = {"bodies": ["quadruped"], "cases": [9], "seeds": range(1), "settings": Settings()}
    return suite(folder, **{**usual, "comparator": "auto", **changes})


def test_the_diagnoses_of_a_run_need_its_trials_which_need_gaits_of_the_bank(tmp_path: Path):
    both = ["forward-displacement", "sensor-series"]
    one, other = ablated(tmp_path, comparators=both).cells()
    trials = one.needs["trials"]

    assert trials.place == other.needs["trials"].place
    assert [gait.parameters["seed"] for gait in trials.needs.values()] == [5, 0]
    (alone,) = ablated(tmp_path, next_trial="repair").cells()
    assert alone.needs["gait"].place == trials.needs["gait-0"].place
    # The trials of a recovery exclude the failing one.
    assert alone.parameters["shared"]["settings"]["trials"] == 1


def test_a_damage_that_is_given_twice_is_one(tmp_path: Path):
    one, other = "friction=0.4+break:back_left_knee", "break:back_left_knee+friction=0.40"
    study = ablated(tmp_path, cases=[], damages=[one, "intact", other, "intact"])

    assert [point["truth"] for point in study.points.values()] == [other[:-1], "intact"]
    assert {point["case"] for point in study.points.values()} == {None}


@pytest.mark.bodies
def test_all_cases_are_those_that_each_robot_can_have(tmp_path: Path):
    study = ablated(tmp_path, robots=["quadruped", "suite-walker-walk"], cases=None)
    found = Counter(point["robot"] for point in study.points.values())

    assert found["quadruped"] == 10
    assert 0 < found["suite-walker-walk"] < 10
    assert 8 not in known_cases(("suite-hopper-hop", "suite-swimmer-swimmer6"))


def test_the_repair_is_the_papers_unless_another_is_given_which_has_its_own_score(tmp_path: Path):
    for made in (ablated, bodies):
        (plain,) = made(tmp_path).cells()
        (robust,) = made(tmp_path, repair="robust").cells()
        (same,) = made(tmp_path, repair="robust", search="cma-es", score="upright").cells()
        shared = plain.parameters["shared"]
        names = ("repair", "search", "score")

        assert [shared[name] for name in names] == ["paper", "ea", "displacement"]
        assert robust.parameters["shared"] == {
            **shared,
            **dict(zip(names, ("robust", "cma-es", "upright"), strict=True)),
        }
        assert robust.place == same.place != plain.place


REFUSED = [
    (ablated, {"robots": []}, "at least one of the robots"),
    (ablated, {"cases": [], "damages": []}, "at least one case or one damage"),
    (ablated, {"cases": [11]}, "unknown case of quadruped '11'"),
    (ablated, {"gaps": [0.7]}, "expected a gap from 0 to 0.5"),
    (ablated, {"next_trial": "repare"}, "unknown choice of the next trial"),
    (ablated, {"next_trial": "repair", "settings": Settings(trials=1)}, "at least 2 trials"),
    (ablated, {"settings": Settings(trials=7)}, "at most 6 trials, got 7"),
    (ablated, {"repair": "papers"}, "unknown repair 'papers'"),
    (ablated, {"repair": "robust", "bank": Path("gaits")}, "nothing is evolved"),
    (ablated, {"bank": Path("gaits")}, "quadruped-0.npz: expected a controller file"),
    (ablated, {"robots": ["a.xml", "./a.xml"]}, "would have the same file names"),
    (bodies, {"cases": [11]}, "unknown case of these bodies '11'"),
    (bodies, {"score": "retrn"}, "unknown score .retrn"),
    (bodies, {"comparator": "no-such"}, "unknown comparator"),
    (bodies, {"controller": "brain"}, "unknown kind of controller"),
    (bodies, {"kinds": "brek"}, "unknown kind 'brek'"),
    (bodies, {"repair": "robust", "search": "repertoire"}, "a study of many has none"),
    (bodies, {"controller": "cpg", "neurons": 4}, "a CPG has no hidden neurons"),
    (paper, {"robots": ["walker"]}, "unknown robot of the paper 'walker'"),
    (paper, {"comparators": [ON_ROBOT]}, "is no comparator"),
]


@pytest.mark.parametrize(("made", "changes", "reason"), REFUSED)
def test_what_cannot_be_run_is_refused_before_anything_is(
    made: type, changes: dict, reason: str, tmp_path: Path
):
    with pytest.raises(InputError, match=reason):
        made(tmp_path / "out", **changes)
    assert not (tmp_path / "out").exists()


def test_oscillators_have_no_neurons_that_could_fail(tmp_path: Path):
    for controller, cases in (("network", [9, 10]), ("cpg", [9])):
        study = bodies(tmp_path, cases=[9, 10], controller=controller)
        assert [point["case"] for point in study.points.values()] == cases


@given(st.integers(1, 7), st.integers(1, 5), st.integers(1, 9))
def test_the_shares_of_a_cluster_are_the_whole_and_nothing_twice(seeds: int, gaps: int, n: int):
    def share(only: tuple[int, int]) -> list[str]:
        levels = [0.1 * gap for gap in range(gaps)]
        return list(ablated(Path("nowhere"), seeds=range(seeds), gaps=levels, only=only).points)

    shares = [share((i, n)) for i in range(1, n + 1)]
    assert sorted(itertools.chain(*shares)) == sorted(share((1, 1)))
    assert max(map(len, shares)) - min(map(len, shares)) <= 1


def test_a_share_of_bodies_has_every_nth_gait_and_its_recoveries(tmp_path: Path):
    found = bodies(tmp_path, cases=[1, 9], seeds=range(3), only=(1, 2))

    assert [point["seed"] for point in found.points.values()] == [0, 0, 2, 2]


@pytest.mark.parametrize("changed", ["biped.toml", "foot.obj"])
def test_a_body_whose_model_changed_is_another_cell(
    changed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    meshed = '<mujoco><asset><mesh name="foot" file="foot.obj"/></asset>'
    shown = '<freejoint/><geom type="mesh" mesh="foot" contype="0" conaffinity="0" mass="0"/>'
    mine = BIPED.replace("<mujoco>", meshed).replace("<freejoint/>", shown)
    (tmp_path / "biped.xml").write_text(mine)
    (tmp_path / "foot.obj").write_text(CUBE)
    (before,) = bodies(tmp_path, bodies=["biped.xml"], cases=[5]).cells()
    others = {"biped.toml": "control_timestep = 0.02", "foot.obj": CUBE.replace(".1", ".2")}
    (tmp_path / changed).write_text(others[changed])
    (after,) = bodies(tmp_path, bodies=["biped.xml"], cases=[5]).cells()

    assert after.parameters != before.parameters
    assert after.needs["gait"].place != before.needs["gait"].place


def test_an_option_of_the_recovery_does_not_change_the_gait_and_one_of_the_gait_does(
    tmp_path: Path,
):
    (plain,), (other,) = bodies(tmp_path).cells(), bodies(tmp_path, gap=0.1, kinds="all").cells()
    (larger,) = bodies(tmp_path, neurons=5).cells()
    gait = plain.needs["gait"]

    assert other.place != plain.place
    assert other.needs["gait"].place == gait.place
    assert larger.needs["gait"].parameters == {**gait.parameters, "neurons": 5}


def test_the_paper_has_each_case_with_each_comparator_and_the_control(tmp_path: Path):
    found = paper(tmp_path, robots=["quadruped"], cases=[1, 7])

    assert [(point["case"], point["comparator"]) for point in found.points.values()] == [
        (case, way) for case in (1, 7) for way in ("forward-displacement", "auto", ON_ROBOT)
    ]
    assert found.cells()[0].parameters["shared"]["calibrated"] is False


def test_domains_of_the_suite_need_no_prefix_where_no_robot_has_that_name():
    assert bodies_of(["quadruped"], None) == ("quadruped",)
    assert bodies_of(["suite-quadruped", "walker"], None) == (
        "suite-quadruped-walk",
        "suite-walker-walk",
    )
    assert bodies_of(["walker", "hopper"], ["stand"]) == (
        "suite-walker-stand",
        "suite-hopper-stand",
    )
    with pytest.raises(InputError, match="has none of the tasks run: it has walk"):
        bodies_of(["hexapod"], ["run"])
    with pytest.raises(InputError, match="unknown task of these domains 'rnu': did you mean run"):
        bodies_of(["walker", "biped.xml"], ["walk", "rnu"])
