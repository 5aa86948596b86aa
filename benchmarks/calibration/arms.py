"""Calibration of arms with known parameters: coverage of its intervals, and harm.

``python -m benchmarks.calibration.arms [--count 8]`` prints a table and writes
``benchmarks/calibration/arms.json``. The physical arms are plain MuJoCo with random parameters;
each is calibrated on one movement, and harm is an error above that of the nominal model in another
kind of movement.
"""

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from time import process_time
from types import MappingProxyType
from typing import Any

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.robot.mjcf.load import adapt_text
from selfmodel.robot.mjcf.settings import MjcfSettings
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import calibrate, prediction_error
from selfmodel.trials.trial import Trial

RESULTS = Path(__file__).with_suffix(".json")
FIRST_SEED = 100

ARM = """<mujoco>
  <option timestep="{timestep}" integrator="implicitfast"/>
  <default>
    <geom contype="0" conaffinity="0" type="capsule" size="0.03"/>
    <joint axis="0 1 0" range="-2 2" damping="{damping}" armature="{armature}" frictionloss="0.1"/>
    <position ctrlrange="-1.5 1.5"/>
  </default>
  <worldbody><body name="base" pos="0 0 1">
    <geom type="box" size="0.05 0.05 0.05"/>
    <body name="upper"><joint name="shoulder"/><geom fromto="0 0 0 {upper}"/>
      <body name="lower" pos="{upper}"><joint name="elbow"/><geom fromto="0 0 0 {lower}"/></body>
    </body>
  </body></worldbody>
  <actuator>
    <position name="shoulder" joint="shoulder" kp="{kp[0]}" kv="{kv[0]}" forcerange="{limit[0]}"/>
    <position name="elbow" joint="elbow" kp="{kp[1]}" kv="{kv[1]}" forcerange="{limit[1]}"/>
  </actuator>
</mujoco>"""

LIGHT = ARM.format(
    timestep=0.005,
    damping=0.3,
    armature=0.01,
    upper="0.25 0 0",
    lower="0.2 0 0",
    kp=(20, 20),
    kv=(1, 1),
    limit=("-20 20", "-20 20"),
)
STIFF = ARM.format(
    timestep=0.002,
    damping=0.5,
    armature=0.02,
    upper="0 0 0.3",
    lower="0 0 0.25",
    kp=(150, 60),
    kv=(10, 4),
    limit=("-40 40", "-15 15"),
)
SERVO = Path(__file__).parents[1] / "servo/pendulum.xml"

ARMS: Mapping[str, tuple[str, float]] = MappingProxyType(
    {
        "light": (LIGHT, 0.01),
        "stiff": (STIFF, 0.01),
        "servo": (SERVO.read_text(encoding="utf-8"), 0.006),
    }
)
"""MJCF and control timestep, s, by name."""

Facts = dict[str, Any]


def main() -> None:
    """Measures, prints and writes."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("--count", type=int, default=8, help="arms of each kind")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    rows = []
    for name in ARMS:
        for seed in range(FIRST_SEED, FIRST_SEED + options.count):
            rows.append(measured(name, seed))
            print(json.dumps(rows[-1]), flush=True)
    options.out.write_text(json.dumps({"rows": rows}, indent=1) + "\n", encoding="utf-8")
    print(table(rows))


def measured(name: str, seed: int) -> Facts:
    """Returns the facts of one arm."""
    mjcf, period = ARMS[name]
    robot = adapt_text("robot", mjcf, {}, MjcfSettings(control_timestep=period))
    rng = np.random.default_rng([seed, *name.encode()])
    physical, truth = drawn(mujoco.MjModel.from_xml_string(mjcf), (0.1, 0.2, 0.4)[seed % 3], rng)
    delay = int(rng.integers(2 * robot.substeps + 1))
    trial, other = (logged(robot, physical, seed + kind, delay, rng) for kind in (0, 1))
    start = process_time()
    found = calibrate(robot, [trial], threads=1)
    seconds = process_time() - start
    number = dict.fromkeys(truth, 0)
    over = []
    for row in (found.joints or {}).get("parameters", ()):
        value = truth[row["quantity"]][number[row["quantity"]]]
        number[row["quantity"]] += 1
        if row["determined"]:
            over.append(abs(np.log(row["value"] / value)) / row["deviation"])
    return {
        "robot": name,
        "seed": seed,
        "chosen": found.chosen,
        "delay_error": abs(found.parameters.delay - delay / robot.substeps),
        "over_deviations": over,
        "error_nominal": prediction_error(robot, [other], 1),
        "error": prediction_error(found.robot, [other], 1),
        "seconds": seconds,
    }


def drawn(
    model: mujoco.MjModel, spread: float, rng: np.random.Generator
) -> tuple[mujoco.MjModel, dict[str, FloatArray]]:
    """Returns a random arm, and the values of its parameters by quantity.

    The logarithms of gains and limits have the deviation ``spread``, those of damping, dry friction
    and armature twice that, and those of the masses half of it.
    """

    def factor(deviation: float, count: int) -> FloatArray:
        return np.exp(deviation * rng.standard_normal(count))

    gain, limit = factor(spread, model.nu), factor(spread, model.nu)
    model.actuator_gainprm *= gain[:, np.newaxis]
    model.actuator_biasprm *= gain[:, np.newaxis]
    model.actuator_forcerange *= limit[:, np.newaxis]
    model.dof_damping *= factor(2 * spread, model.nv)
    model.dof_frictionloss *= factor(2 * spread, model.nv)
    model.dof_armature *= factor(2 * spread, model.nv)
    masses = factor(spread / 2, model.nbody)
    model.body_mass *= masses
    model.body_inertia *= masses[:, np.newaxis]
    return model, {
        "gain": gain,
        "force limit": limit,
        "damping": model.dof_damping,
        "dry friction": model.dof_frictionloss,
        "armature": model.dof_armature,
    }


def logged(
    robot: Robot, model: mujoco.MjModel, kind: int, delay: int, rng: np.random.Generator
) -> Trial:
    """Returns the noisy log of 8 s: two sinusoids, plateaus, or steps that become faster.

    The commands are ``delay`` physics steps late.
    """
    time = np.arange(round(8 / robot.control_timestep)) * robot.control_timestep
    slow, fast, turn, other = rng.uniform((0.2, 0.6, 0, 0), (0.5, 1.5, 6, 6), (model.nu, 4)).T
    phase = 2 * np.pi * time[:, np.newaxis] * slow + turn
    commands = (
        lambda: 0.7 * np.sin(phase) + 0.5 * np.sin(phase * fast / slow + other),
        lambda: np.clip(3 * np.sin(phase), -1, 1),
        lambda: np.sign(np.sin(phase / 2 * (1 + 0.15 * time[:, np.newaxis]))),
    )[kind % 3]()
    data, states = mujoco.MjData(model), []
    mujoco.mj_setConst(model, data)
    mujoco.mj_resetData(model, data)
    for step in range(len(time)):
        states.append(np.concatenate([data.qpos, data.qvel]))
        for part in range(robot.substeps):
            arrived = (step * robot.substeps + part - delay) // robot.substeps
            data.ctrl[:] = commands[arrived] if arrived >= 0 else 0.0
            mujoco.mj_step(model, data)
    noise = rng.normal(0.0, np.repeat((0.002, 0.04), model.nv), (len(time), 2 * model.nv))
    positions, velocities = np.hsplit(np.array(states) + noise, 2)
    return Trial.from_arrays(
        robot, positions, commands, joint_velocities=velocities, stage="before", name=f"kind{kind}"
    )


def table(rows: list[Facts]) -> str:
    """Returns the rates of each kind of arm as Markdown."""
    header = (
        "| arm | arms | fitted | delay wrong by half a step | determined within 68 %, 95 % | harm "
        "| error relative to nominal: median, worst | seconds |"
    )
    lines = [header, "|---" * 8 + "|"]
    for name in (*ARMS, "all"):
        own = [row for row in rows if name in (row["robot"], "all")]
        over = np.concatenate([row["over_deviations"] for row in own])
        ratio = np.array([row["error"] / row["error_nominal"] for row in own])
        lines.append(
            f"| {name} | {len(own)} | {sum(row['chosen'] != 'nominal' for row in own)} "
            f"| {sum(row['delay_error'] >= 0.5 for row in own)} "
            f"| {np.mean(over < 1):.0%}, {np.mean(over < 1.96):.0%} of {len(over)} "
            f"| {sum(ratio > 1.001)} | {np.median(ratio):.2g}, {ratio.max():.3g} "
            f"| {np.mean([row['seconds'] for row in own]):.1f} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    main()
