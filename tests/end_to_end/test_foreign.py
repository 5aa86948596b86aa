"""Recordings of the independent generator: what it makes, and how answers are judged."""

import ast
import itertools
import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from benchmarks.foreign.cases import CASES, NOTATION, UNKNOWN, Fault, faults_of, stream
from benchmarks.foreign.diagram import diagram
from benchmarks.foreign.generate import Plan, generate
from benchmarks.foreign.model import compiled, draw_gap
from benchmarks.foreign.robots import NAMES, Robot, robot
from benchmarks.foreign.scoring import is_expressible, judged, reliability, terms
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.registry import ALL_KINDS
from selfmodel.robot.robot import Robot as Body
from tests.helpers.command import succeeds

FOLDER = Path(__file__).parents[2] / "benchmarks" / "foreign"


def imported(path: Path) -> set[str]:
    nodes = list(ast.walk(ast.parse(path.read_text())))
    names = {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
    return names | {a.name for node in nodes if isinstance(node, ast.Import) for a in node.names}


SCORER = ("__main__", "scoring", "diagram")
GENERATOR = [path for path in sorted(FOLDER.rglob("*.py")) if path.stem not in SCORER]


@pytest.mark.parametrize("path", GENERATOR, ids=lambda path: path.stem)
def test_the_generator_imports_nothing_of_selfmodel_and_of_the_scorer(path: Path):
    names = imported(path)

    assert not [name for name in names if name.split(".")[0] == "selfmodel"]
    assert not [name for name in names if name.startswith("benchmarks.foreign.scoring")]


@pytest.fixture(scope="module", params=NAMES)
def machine(request: pytest.FixtureRequest) -> Robot:
    return robot(request.param)


def model_of(machine: Robot, *faults: Fault, gap: float = 0.0) -> mujoco.MjModel:
    return compiled(machine, draw_gap(machine, gap, stream(0)), faults)


def test_a_lost_limb_is_deleted_with_its_mass_hinges_and_motors(machine: Robot):
    part = machine.parts[0]

    whole, left = model_of(machine), model_of(machine, Fault("lost", part.name))

    lost = whole.njnt - left.njnt
    assert lost == len(part.beyond) == whole.nu - left.nu
    assert mujoco.mj_name2id(left, mujoco.mjtObj.mjOBJ_BODY, part.body) == -1
    assert left.body_mass.sum() < whole.body_mass.sum() - 0.01


def test_a_jam_fixes_the_body_at_the_angle_of_its_hinge(machine: Robot):
    part = next(part for part in machine.parts if len(part.hinges) == 1)
    whole, jammed = model_of(machine), model_of(machine, Fault("jam", part.name, 0.3))
    data, fixed = mujoco.MjData(whole), mujoco.MjData(jammed)
    data.qpos[whole.joint(part.hinges[0]).qposadr[0]] = 0.3

    mujoco.mj_forward(whole, data)
    mujoco.mj_forward(jammed, fixed)

    assert jammed.njnt == whole.njnt - 1
    for body in range(whole.nbody):
        assert data.xquat[body] == pytest.approx(fixed.xquat[body], abs=1e-9)
        assert data.xpos[body] == pytest.approx(fixed.xpos[body], abs=1e-9)


def test_a_gap_changes_each_limb_and_motor_independently_and_none_changes_nothing(machine: Robot):
    ideal, real = model_of(machine), model_of(machine, gap=1.0)

    mass = real.body_mass[1:] / ideal.body_mass[1:]
    gain = real.actuator_gainprm[:, 0] / ideal.actuator_gainprm[:, 0]

    np.testing.assert_array_equal(ideal.body_mass, machine.spec().compile().body_mass)
    for factors in (mass, gain):
        assert np.unique(factors.round(9)).size == factors.size
        assert np.abs(factors - 1).max() <= 0.1 + 1e-9
    assert real.opt.timestep == 0.001


@pytest.mark.search
def test_every_case_has_faults_of_known_kinds_that_compile_on_every_robot(machine: Robot):
    for name, case in CASES.items():
        faults = faults_of(case, machine, 3)

        assert faults == () or model_of(machine, *faults).nq, name
        for fault in faults:
            assert fault.kind in {*NOTATION, *UNKNOWN, "encoder"}, name


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("foreign")
    # With this seed, the limb is lost early enough in a trial of 3.5 s.
    return generate(out, Plan("quadruped", "onset-break", 169, "large", duration=3.5, trials=1))


def joint_states(bag: Path) -> tuple[list[str], np.ndarray, np.ndarray]:
    with AnyReader([bag]) as reader:
        chosen = [c for c in reader.connections if c.topic == "/joint_states"]
        read = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(chosen)]
    time = np.array([m.header.stamp.sec + m.header.stamp.nanosec * 1e-9 for m in read])
    return read[0].name, time - 1.7e9, np.array([m.position for m in read])


@pytest.mark.search
def test_the_encoder_of_a_limb_that_is_lost_in_mid_trial_moves_before_and_is_frozen_after(
    recording: Path,
):
    truth = json.loads((recording / "truth.json").read_text())
    (fault,) = truth["faults"]
    names, time, angles = joint_states(recording / "after-1")

    column = angles[:, names.index(f"{fault['part']}_joint")]

    assert fault["encoders"] == "freezes"
    assert truth["truth"] == [f"break:{fault['part']}"]
    assert column[time < truth["onset"]].std() > 0.05
    assert np.ptp(column[time > truth["onset"] + 0.02]) == 0


@pytest.mark.process
@pytest.mark.search
def test_recordings_are_imported_by_their_mappings(recording: Path, tmp_path: Path):
    for name in ("before", "after-1"):
        log = str(tmp_path / f"{name}.mcap")
        done = succeeds(
            "logs", "import", name, "--mapping", f"{name}.toml", "--out", log, "--json",
            cwd=recording,
        )  # fmt: skip
        assert "far from the model's start pose" not in done.stdout


def row(truth: list[str], best: str, verdict: str, **more: object) -> dict[str, object]:
    return {
        "name": "made",
        "seconds": 1.0,
        "truth": {"truth": truth, "onset": None, "group": "paper"},
        "answer": {
            "diagnosis": [{"hypothesis": best, "distance": 1.0}],
            "kinds": ["break", "jam", "jam-angle", "motor"],
            "verdict": verdict,
            **more,
        },
    }


def test_a_trial_that_ends_before_its_fault_begins_is_not_recorded(tmp_path: Path):
    with pytest.raises(SystemExit, match="17 s"):
        generate(tmp_path, Plan("go2", "long-motor", 0, "none", duration=10.0))

    assert not list(tmp_path.iterdir())


def test_a_trial_with_a_gait_of_its_own_has_two_healthy_trials_of_other_gaits(tmp_path: Path):
    plan = Plan("quadruped", "healthy", 1, "none", duration=1.0, trials=1, own_gait=True)

    made = generate(tmp_path, plan)

    stages = {path.stem: "before" in path.read_text() for path in made.glob("*.toml")}
    assert stages == {"before": True, "before-2": True, "after-1": False}
    spreads = [joint_states(made / name)[2].std(axis=0) for name in stages]
    assert all(
        np.abs(one - other).mean() > 0.1 * other.mean()
        for one, other in itertools.combinations(spreads, 2)
    )


@pytest.mark.parametrize(
    ("truth", "best", "verdict", "right"),
    [
        ([], "intact", "explained", True),
        ([], "intact", "unexplained", False),
        ([], "motor:a=0.4", "explained", False),
        (["break:a"], "break:a", "explained", True),
        (["break:a"], "break:a", "unexplained", False),
        (["break:a"], "break:b", "explained", False),
        (["jam:a=0.3"], "jam:a=0.34", "explained", True),
        (["jam:a=0.3"], "jam:a", "explained", False),
        (["break:a", "jam:b"], "jam:b+break:a", "explained", True),
        (["outside:tether"], "intact", "unexplained", True),
        (["outside:tether"], "motor:a=0.5", "explained", False),
        (["break:a"], "jam:a", "ambiguous with break:a", True),
        (["break:a"], "jam:a", "ambiguous with jam:b", False),
    ],
)
def test_a_verdict_is_right_if_it_is_about_the_truth(
    truth: list[str], best: str, verdict: str, *, right: bool
):
    verdict, *named = verdict.split(" with ")
    assert judged(row(truth, best, verdict, indistinguishable=named)).verdict_right is right


def test_what_is_stated_is_so_if_it_is_the_truth_and_intact_if_no_fault_is_beyond_a_limit():
    limit = {"kind": "motor", "part": "a", "below": 0.3, "above": None}
    sure = {"probability": {"intact": 0.9}, "detectable": [limit]}
    found = [
        judged(row(["break:a"], "break:a", "explained", probability={"break:a": 0.9})),
        judged(row(["break:a"], "break:b", "explained", probability={"break:b": 0.9})),
        judged(row(["outside:tether"], "jam:a", "unexplained", probability={"jam:a": 0.1})),
        judged(row(["motor:a=0.4"], "intact", "intact", **sure)),
        judged(row(["motor:a=0.2"], "intact", "intact", **sure)),
    ]

    assert [one.probability for one in found] == [0.9] * 5
    assert [one.is_so for one in found] == [True, False, True, True, False]


def test_the_calibration_error_is_the_mean_difference_of_probability_and_rate():
    rows = [
        row(["break:a"], best, "explained", probability={best: sure})
        for best, sure, count in (("break:a", 0.92, 9), ("break:b", 0.92, 1), ("break:a", 0.6, 10))
        for _ in range(count)
    ]

    found = reliability(rows)

    assert "| 90% to 95% | 10 | 92.0% | 9/10, 90 %" in found
    assert "Calibration error 21.0% (" in found


def test_the_reliability_diagram_of_the_results_is_drawn_from_their_rows():
    results = FOLDER.parents[1] / "docs" / "results"
    named = ("foreign-own-gaits-again", "foreign-long")
    (axes,) = diagram([results / "data" / f"{name}.csv" for name in named]).axes

    assert len(axes.containers) == 3, "a point per row of the reliability table"
    assert f"*{axes.get_title()};" in (results / "foreign.md").read_text()


def test_a_row_tells_false_alarms_missed_faults_and_inventions_apart():
    assert judged(row([], "motor:a=0.4", "explained")).false_alarm
    assert not judged(row([], "motor:a=0.4", "not judged")).false_alarm
    assert judged(row([], "motor:a=0.4", "not judged")).not_judged
    assert judged(row(["break:a"], "intact", "explained")).called_intact
    assert judged(row(["break:a"], "break:a+motor:b=0.5", "explained")).invented
    assert judged(row(["motor:a=0.4"], "motor:a=0.5", "explained")).severity_error == (
        pytest.approx(0.25)
    )
    assert judged({**row(["break:a"], "", ""), "answer": None}).verdict_right is False


@pytest.mark.parametrize("kind", ALL_KINDS, ids=lambda kind: kind.name)
def test_a_fault_is_expressible_if_its_own_kind_is_considered(kind: FaultKind, quadruped: Body):
    read = terms([str(kind.candidates(quadruped.anatomy)[0])])
    others = [other.name for other in ALL_KINDS if other != kind]

    assert is_expressible(read, [kind.name])
    assert not is_expressible(read, others)
