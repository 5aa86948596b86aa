"""Promises of a diagnosis for other software: status by joint, ranges, and the damaged model."""

import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import selfmodel
from selfmodel.diagnosis.diagnosis import Candidate, DetectableSeverity, Diagnosis
from selfmodel.errors import InputError
from selfmodel.faults.build import build, edited_mjcf
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import ALL_KINDS, notation_kinds
from selfmodel.logs.export import status_of
from selfmodel.robot.robot import Robot
from tests.helpers.command import SMALL, succeeds
from tests.helpers.robots.arms import robot_of
from tests.helpers.robots.bodies import BODIES
from tests.helpers.robots.go1 import go1

LEGS = [
    [f"{leg}_{part}" for part in ("shoulder", "knee")]
    for leg in ("front_left", "front_right", "back_left", "back_right")
]


def diagnosed(robot: Robot, best: str, *others: str, **numbers: object) -> Diagnosis:
    best, *others = (
        parse(one, robot.anatomy, notation_kinds(ALL_KINDS)) for one in (best, *others)
    )
    return Diagnosis((Candidate(best, 0.0),), 1, 1.0, tuple(others), "ambiguous", "test", **numbers)


@pytest.mark.parametrize(
    ("notation", "lost"),
    [
        ("intact", {}),
        ("break:front_left_shoulder", {"front_left_shoulder": 0, "front_left_knee": 0}),
        ("break:back_right_knee", {"back_right_knee": 0}),
        (
            "jam:front_right_knee=0.3+jam:back_left_knee",
            {"front_right_knee": 0, "back_left_knee": 0},
        ),
        ("motor:back_left_knee=0.3", {"back_left_knee": 0.3}),
        ("motor:back_left_knee=off0.1", {"back_left_knee": 0}),
        ("motor:back_left_knee=0.5+servo-gain:back_left_knee=0.5", {"back_left_knee": 0.25}),
        ("damping:back_left_knee=3.0+friction=0.3+sensor:front_left_touch", {}),
    ],
)
def test_the_status_of_a_joint_is_what_its_motor_can_still_do(
    quadruped: Robot, notation: str, lost: dict[str, float]
):
    found = status_of(diagnosed(quadruped, notation), quadruped)

    assert found["joints"] == LEGS
    assert found["status"] == [[lost.get(joint, 1) for joint in leg] for leg in LEGS]
    assert found["other_joints"] == {}
    assert found["not_in_model"] == [one for one in notation.split("+") if "sensor" in one]


def test_joints_that_belong_to_no_limb_are_named_beside_them():
    robot = BODIES["humanoid"]()
    found = status_of(diagnosed(robot, "jam:abdomen"), robot)
    joints = {joint for limb in found["joints"] for joint in limb}

    assert found["other_joints"] == {"abdomen": 0.0, "abdomen_x": 1.0}
    assert joints | {"abdomen", "abdomen_x"} == {joint.name for joint in robot.anatomy.joints}


def test_a_robot_with_four_legs_of_three_joints_has_four_rows_of_three():
    robot = robot_of(go1())
    found = np.array(status_of(diagnosed(robot, "motor:FL_thigh_joint=0.0"), robot)["status"])

    assert found.shape == (4, 3)
    assert (found == 0).sum() == 1


def ranges(robot: Robot, *notations: str, **numbers: object) -> dict[str, tuple[float, float]]:
    found = status_of(diagnosed(robot, *notations, **numbers), robot)["ranges"]
    return {
        f"{one['kind']}:{one['part']}{'' if one['found'] else '?'}": (one["low"], one["high"])
        for one in found
    }


def test_a_range_has_the_severities_that_cannot_be_told_apart(quadruped: Robot):
    knee = "motor:back_left_knee"
    shown = (DetectableSeverity("motor", "front_left_knee", 0.7, None),)
    shown += (DetectableSeverity("motor", "back_left_knee", None, None),)
    shown += (DetectableSeverity("payload", "", None, 0.4), DetectableSeverity("mine", "", 1, 2))

    assert ranges(quadruped, f"{knee}=0.37") == {"motor:back_left_knee": (0.335, 0.385)}
    assert ranges(quadruped, f"{knee}=0.0") == {"motor:back_left_knee": (0.0, 0.05)}
    both = ranges(quadruped, f"{knee}=0.3", f"{knee}=0.5+break:front_left_knee")
    assert both == {"motor:back_left_knee": (0.25, 0.55)}
    assert ranges(quadruped, f"{knee}=0.3", "intact") == {"motor:back_left_knee": (0.25, 1.0)}
    assert ranges(quadruped, f"{knee}=0.3", detectable=shown) == {
        "motor:back_left_knee": (0.25, 0.35),
        "motor:front_left_knee?": (0.7, 1.0),
        "payload:?": (0.0, 0.4),
    }


FAULTS = (
    *("intact", "break:{0}", "jam:{1}", "jam:{1}=0.3", "motor:{1}=0.0", "motor:{1}=0.4"),
    *("motor:{1}=off0.1", "servo-gain:{1}=0.5", "damping:{1}=3.0", "joint-friction:{1}=0.2"),
    *("encoder-offset:{1}=slip0.1", "grip:{1}=0.3", "payload:front=0.2", "friction=0.4"),
    *("wind=5.0", "roughness=0.02", "load:{1}=0.2", "slope=0.1", "delay=2.0"),
)
PARTS = (
    "body_",
    "geom_",
    "jnt_",
    "dof_",
    "actuator_",
    "tendon_",
    "eq_",
    "pair_",
    "qpos0",
    "hfield",
)
UNUSED = ("range", "bvh", "invweight0")
"""Fields without an effect on the motion, where they differ: of limits that are off, and so on."""


@pytest.mark.parametrize("fault", FAULTS)
def test_the_edited_mjcf_is_the_model_that_a_diagnosis_simulates(robot: Robot, fault: str):
    leg = [joint.name for joint in robot.anatomy.joints if "front_left" in joint.name]
    hypothesis = parse(fault.format(leg[0], leg[-1]), robot.anatomy, notation_kinds(ALL_KINDS))
    expected = build(robot, hypothesis)
    mjcf = edited_mjcf(robot, hypothesis)
    found = mujoco.MjModel.from_xml_string(mjcf, dict(robot.assets))

    for name in filter(lambda name: name.startswith(PARTS), dir(expected.model)):
        value, own = getattr(found, name), getattr(expected.model, name)
        if isinstance(own, np.ndarray) and not any(one in name for one in UNUSED):
            np.testing.assert_allclose(value, own, rtol=1e-5, atol=1e-5, err_msg=name)
    np.testing.assert_array_equal(found.opt.wind, expected.model.opt.wind)
    assert found.opt.density == pytest.approx(expected.model.opt.density)
    delayed = replace(robot, mjcf=mjcf).control_delay
    assert delayed == robot.control_delay + expected.added_delay[0]


def test_a_robot_with_a_delay_of_its_own_has_the_sum_in_its_edited_mjcf(quadruped: Robot):
    delayed = [parse(f"delay={steps}", quadruped.anatomy) for steps in (1.0, 2.0)]
    once = replace(quadruped, mjcf=edited_mjcf(quadruped, delayed[0]))
    assert replace(once, mjcf=edited_mjcf(once, delayed[1])).control_delay == 3


def test_files_are_written_once_and_read_by_mujoco(tmp_path: Path, quadruped: Robot):
    diagnosis, folder = diagnosed(quadruped, "motor:back_left_knee=0.3"), tmp_path / "new" / "out"
    assert selfmodel.export_diagnosis(diagnosis, quadruped, folder) == folder
    model = mujoco.MjModel.from_xml_path(str(folder / "model.xml"))

    content = json.loads((folder / "status.json").read_text())
    assert content == status_of(diagnosis, quadruped)
    gain = quadruped.model.actuator("back_left_knee").gainprm[0]
    assert model.actuator("back_left_knee").gainprm[0] == pytest.approx(0.3 * gain, rel=1e-5)
    with pytest.raises(InputError, match=r"model\.xml exists, and is not overwritten"):
        selfmodel.export_diagnosis(diagnosis, "quadruped", folder)


def test_diagnose_writes_the_folder_beside_its_answer(tmp_path: Path):
    for stage, damage in (("before", "intact"), ("after", "break:front_left_knee")):
        run = ("--steps", "60", "--stage", stage, "--damage", damage, "--out", f"{stage}.mcap")
        succeeds("trial", "quadruped", *run, cwd=tmp_path)
    run = ("diagnose", "after.mcap", "before.mcap", *SMALL, "--no-calibrate", "--kinds", "break")
    done = succeeds(*run, "--export", "out", cwd=tmp_path)
    status = json.loads((tmp_path / "out" / "status.json").read_text())

    assert "For other software: out" in done.stdout
    assert status["hypothesis"] == "break:front_left_knee"
    assert status["status"][0] == [1.0, 0.0]
