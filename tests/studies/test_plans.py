"""Promises of what a study consists of: its robots, failures, gaits, and shares."""

import itertools
from dataclasses import replace
from pathlib import Path

import pytest

from selfmodel.arguments import robot_entry
from selfmodel.errors import InputError
from selfmodel.settings import RepairSettings, Settings
from selfmodel.studies.bodies import bodies_of, known_cases
from selfmodel.studies.plans import ablation, paper, suite
from selfmodel.studies.recoveries import ON_ROBOT, planned
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


def values(study: Study, name: str) -> list:
    return [point[name] for point in study.points.values()]


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


def test_the_searches_of_an_ablation_are_an_axis_at_one_limit_which_may_be_extended(tmp_path: Path):
    (first,) = ablated(tmp_path, settings=SMALL).cells()
    study = ablated(tmp_path, diagnostic_searches=["ea", "stepwise"])
    assert values(study, "diagnostic_search") == ["ea", "stepwise"]
    _, same = study.cells()
    assert same.place == first.place
    limit = same.parameters["shared"]["settings"]["max_simulated_steps"]
    assert limit == SMALL.evaluations * SMALL.steps
    own = ablated(tmp_path, settings=replace(SMALL, max_simulated_steps=700)).cells()[0]
    assert own.parameters["shared"]["settings"]["max_simulated_steps"] == 700
    with pytest.raises(InputError, match="stepwise"):
        ablated(tmp_path, diagnostic_searches="steps")
    with pytest.raises(InputError, match="diagnostic_searches"):
        ablated(tmp_path, settings=replace(SMALL, diagnostic_search="ea"))


PLUG_INS = """
from dataclasses import replace
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.faults import KINDS
from selfmodel.recovery import DISPLACEMENT

WAY = replace(FORWARD_DISPLACEMENT, name="mine")
LIMP = replace(KINDS["jam"], name="limp", keyword="limp")
SCORE = replace(DISPLACEMENT, name="mine", of=lambda *_: DISPLACEMENT.of(*_))
"""


def test_the_cells_of_a_plug_in_are_those_that_call_it_and_those_that_need_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.syspath_prepend(str(tmp_path))
    for name in ("plan_way", "plan_kind", "plan_score"):
        (tmp_path / f"{name}.py").write_text(PLUG_INS)
    ways, kinds = ["forward-displacement", "plan_way:WAY"], "break,plan_kind:LIMP"
    study = ablated(tmp_path, comparators=ways, kinds=kinds, damages=["limp:front_left_knee"])
    runs = [(cell, cell.needs["trials"]) for cell in study.cells()]

    assert [cell.modules for cell, _ in runs] == [("plan_kind",), ("plan_kind", "plan_way")] * 2
    assert [trials.modules for _, trials in runs] == [(), (), ("plan_kind",), ("plan_kind",)]
    assert {gait.modules for _, trials in runs for gait in trials.needs.values()} == {()}
    (scored,) = ablated(tmp_path, score="plan_score:SCORE").cells()
    gait = scored.needs["trials"].needs["gait-0"]
    assert gait.modules == ("plan_score",)
    assert list(gait.made_with())[-1] == list(scored.made_with())[-1] == "plan_score.py"


def test_a_damage_that_is_given_twice_is_one(tmp_path: Path):
    one, other = "friction=0.4+break:back_left_knee", "break:back_left_knee+friction=0.40"
    study = ablated(tmp_path, cases=[], damages=[one, "intact", other, "intact"])

    assert values(study, "truth") == [other[:-1], "intact"]
    assert values(study, "case") == [None, None]


@pytest.mark.bodies
def test_all_cases_are_those_that_each_robot_can_have(tmp_path: Path):
    robots = values(
        ablated(tmp_path, robots=["quadruped", "suite-walker-walk"], cases=None), "robot"
    )

    assert robots.count("quadruped") == 10
    assert 0 < robots.count("suite-walker-walk") < 10
    assert 8 not in known_cases(("suite-hopper-hop", "suite-swimmer-swimmer6"))
    rewarded = bodies(tmp_path, bodies=["suite-walker-stand"], cases=[3], score="return", neurons=5)
    (cell,) = rewarded.cells()
    assert cell.needs["gait"].parameters["score"] == "return"


@pytest.mark.parametrize("made", [ablated, bodies])
def test_the_repair_is_that_of_a_recovery_unless_another_is_given_which_has_its_own_score(
    made: type, tmp_path: Path
):
    (plain,) = made(tmp_path).cells()
    (papers,) = made(tmp_path, repair="paper").cells()
    (same,) = made(tmp_path, repair="robust", search="cma-es", score="upright").cells()
    shared, names = plain.parameters["shared"], ("repair", "search", "score")

    assert [shared[name] for name in names] == ["robust", "cma-es", "upright"]
    assert papers.parameters["shared"] == {
        **shared,
        **dict(zip(names, ("paper", "ea", "displacement"), strict=True)),
    }
    assert plain.place == same.place != papers.place
    (larger,) = made(tmp_path, repair_settings=RepairSettings(generations=9)).cells()
    (gait, *_), (own, *_) = (
        list((one.needs.get("trials") or one).needs.values()) for one in (plain, larger)
    )
    assert own.parameters["settings"]["generations"] == 9
    assert own.parameters["settings"]["steps"] == gait.parameters["settings"]["steps"]
    assert "repair_settings" not in shared


@pytest.mark.parametrize(
    ("made", "changes", "reason"),
    [
        (ablated, {"robots": []}, "at least one of the robots"),
        (ablated, {"cases": [], "damages": []}, "at least one case or one damage"),
        (ablated, {"cases": [11]}, "unknown case of quadruped '11'"),
        (ablated, {"gaps": [0.7]}, "expected a gap from 0 to 0.5"),
        (ablated, {"next_trial": "repare"}, "unknown choice of the next trial"),
        (ablated, {"next_trial": "repair", "settings": Settings(trials=1)}, "at least 2 trials"),
        (
            ablated,
            {
                "settings": Settings(steps=40),
                "comparators": ["sensor-series", "segment-prediction"],
            },
            "segment-prediction needs 49 steps or more, and the trial has 40: give more steps",
        ),
        (ablated, {"settings": Settings(trials=7)}, "at most 6 trials, got 7"),
        (ablated, {"repair": "papers"}, "unknown repair 'papers'"),
        (ablated, {"repair": "robust", "bank": Path("gaits")}, "nothing is evolved"),
        (
            ablated,
            {"repair_settings": RepairSettings(), "bank": Path("gaits")},
            "nothing is evolved",
        ),
        (ablated, {"bank": Path("gaits")}, "quadruped-5.npz: expected a controller file"),
        (ablated, {"robots": ["a.xml", "./a.xml"], "cases": [9]}, "would have the same file names"),
        (ablated, {"only": (0, 1)}, r"only=\(2, 8\), got \(0, 1\)"),
        (bodies, {"cases": [11]}, "unknown case of these bodies '11'"),
        (bodies, {"cases": []}, "at least one case or one damage"),
        (bodies, {"damages": "jam:nose"}, "no body can have jam:nose: unknown part in the term"),
        (bodies, {"score": "retrn"}, "unknown score .retrn"),
        (bodies, {"comparator": "no-such"}, "unknown comparator"),
        (bodies, {"controller": "brain"}, "unknown kind of controller"),
        (bodies, {"kinds": "brek"}, "unknown kind 'brek'"),
        (bodies, {"repair": "robust", "search": "repertoire"}, "a study of many has none"),
        (bodies, {"controller": "cpg", "neurons": 4}, "a CPG has no hidden neurons"),
        (paper, {"robots": ["walker"]}, "unknown robot of the paper 'walker'"),
        (paper, {"comparators": [ON_ROBOT]}, "is no comparator"),
    ],
)
def test_what_cannot_be_run_is_refused_before_anything_is(
    made: type, changes: dict, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.xml").write_text(BIPED)
    with pytest.raises(InputError, match=reason):
        made(tmp_path / "out", **changes).cells()
    assert not (tmp_path / "out").exists()


def test_a_failure_that_a_body_cannot_have_is_a_run_of_its_first_seed_with_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "biped.xml").write_text(BIPED)
    one, same = "friction=0.4+jam:left_hip", "jam:left_hip+friction=0.40"
    study = bodies(
        tmp_path,
        bodies=["quadruped", "biped.xml"],
        cases=[1, 10],
        damages=[one, same],
        seeds=[3, 4],
        controller="cpg",
    )
    reasons = {}
    for cell in study.cells():
        given = cell.parameters
        reasons[given["robot"], given["case"], given["truth"], given["seed"]] = (
            given.get("reason", ""),
            len(cell.needs),
        )

    assert {key for key, (reason, _) in reasons.items() if not reason} == {
        *(("quadruped", 1, "break:front_left_knee", seed) for seed in (3, 4)),
        *(("biped.xml", None, one, seed) for seed in (3, 4)),
    }
    told = {key[:3]: reason for key, (reason, _) in reasons.items() if reason}
    assert told.keys() == {
        *(("quadruped", 10, ""), ("quadruped", None, one), ("quadruped", None, same)),
        *(("biped.xml", 1, ""), ("biped.xml", 10, "")),
    }
    assert "does not apply to biped.xml: it needs a limb of two joints" in told["biped.xml", 1, ""]
    assert "for jam 'left_hip': the known ones are" in told["quadruped", None, one]
    assert "neuron:0 does not apply to a CPG" in told["quadruped", 10, ""]
    assert all(needs == (not reason) for reason, needs in reasons.values()), "no gait is evolved"


def test_the_shares_of_a_cluster_are_the_whole_and_nothing_twice(tmp_path: Path):
    def share(*only: int) -> list[str]:
        return list(ablated(tmp_path, seeds=range(3), gaps=[0.0, 0.1], only=only).points)

    shares = [share(i, 4) for i in range(1, 5)]
    assert sorted(itertools.chain(*shares)) == sorted(share(1, 1))
    assert max(map(len, shares)) - min(map(len, shares)) <= 1
    # A share of bodies has every nth gait with all of its recoveries.
    assert values(bodies(tmp_path, cases=[1, 9], seeds=range(3), only=(1, 2)), "seed") == [
        0,
        0,
        2,
        2,
    ]


def test_an_ablation_whose_limit_is_too_small_for_a_comparator_is_refused(tmp_path: Path):
    few = replace(SMALL, max_simulated_steps=SMALL.steps + 1)
    with pytest.raises(InputError, match="as noisy-transfer simulates for one hypothesis"):
        ablated(tmp_path, settings=few, comparators=["forward-displacement", "noisy-transfer"])


def test_a_number_of_seeds_is_a_count_and_a_sequence_has_the_seeds(tmp_path: Path):
    for plan in (ablated, bodies):
        assert set(values(plan(tmp_path, seeds=2), "seed")) == {0, 1}
        assert set(values(plan(tmp_path, seeds=[2]), "seed")) == {2}
        with pytest.raises(InputError, match="of 1 or above as seeds, got 0"):
            plan(tmp_path, seeds=0)
    assert set(values(paper(tmp_path, robots="quadruped", cases=1, seeds=2), "seed")) == {0, 1}


def test_a_body_whose_model_changed_is_another_cell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    meshed = '<mujoco><asset><mesh name="foot" file="foot.obj"/></asset>'
    shown = '<freejoint/><geom type="mesh" mesh="foot" contype="0" conaffinity="0" mass="0"/>'
    mine = BIPED.replace("<mujoco>", meshed).replace("<freejoint/>", shown)
    files = {"biped.xml": mine, "foot.obj": CUBE}
    models = set()
    for changed in (
        {},
        {"foot.obj": CUBE.replace(".1", ".2")},
        {"biped.toml": "control_timestep = 0.02"},
    ):
        for name, text in (files | changed).items():
            (tmp_path / name).write_text(text)
        models.add(planned("biped.xml", robot_entry("biped.xml"))["model"])

    assert len(models) == 3


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

    assert values(found, "comparator") == ["forward-displacement", "auto", ON_ROBOT] * 2
    assert values(found, "case") == [1, 1, 1, 7, 7, 7]
    assert found.cells()[0].parameters["shared"]["calibrated"] is False


def test_domains_of_the_suite_need_no_prefix_where_no_robot_has_that_name():
    assert bodies_of(["quadruped"], None) == ("quadruped",)
    both = ("suite-quadruped-walk", "suite-walker-walk")
    assert bodies_of(["suite-quadruped", "walker"], None) == both
    both = ("suite-walker-stand", "suite-hopper-stand")
    assert bodies_of(["walker", "hopper"], ["stand"]) == both
    with pytest.raises(InputError, match="has none of the tasks run: it has walk"):
        bodies_of(["hexapod"], ["run"])
    with pytest.raises(InputError, match="unknown task of these domains 'rnu': did you mean run"):
        bodies_of(["walker", "biped.xml"], ["walk", "rnu"])
