"""Coverage of the intervals of calibrations, and the rate at which they do harm.

``python -m benchmarks.calibration.coverage [--robots quadruped,hexapod] [--count 24]`` prints a
table and writes ``benchmarks/calibration/coverage.json``. Each physical robot is plain MuJoCo with
random parameters, under the commands of a gait of the bank on the nominal model; it is calibrated
on a trial of one gait. Harm is an error above that of the nominal model in a trial of another gait,
which was not fitted.
"""

import argparse
import json
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time
from typing import Any

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.robot.robot import Robot
from selfmodel.simulation.calibration import calibrate, prediction_error
from selfmodel.simulation.model_factors import (
    factor_names,
    nominal,
    scale_contacts,
    with_parameters,
)
from selfmodel.studies.recoveries import bank_gait
from selfmodel.tasks import ROBOTS
from selfmodel.trials.trajectory import collect
from selfmodel.trials.trial import Trial

RESULTS = Path(__file__).with_suffix(".json")
STEPS = 1000
"""Control steps of a trial."""
GAITS = 2
"""Gaits of the bank: each robot is calibrated on one and predicted in the next."""
FIRST_SEED = 100
"""Seed of the first robot; the constants of calibration were chosen with seeds below it."""
FRICTION = 0.8
"""Friction of the robots of the row ``friction 0.8``, as a factor."""

HARM = 1.001
"""Ratio of errors that counts as harm: an MJCF has numbers of six digits."""

MAX_DELAY = 2
"""Largest control delay, control steps."""

NOISE = {
    "joint_positions": 0.01,
    "joint_velocities": 0.1,
    "base_position": 0.005,
    "base_linear_velocity": 0.03,
    "base_angular_velocity": 0.03,
}
"""Standard deviation of the noise of each logged signal at a spread of 0.1, in its unit."""

TILT_NOISE = 0.01
"""Standard deviation of the logged orientation at a spread of 0.1, rad."""

Facts = dict[str, Any]


def main() -> None:
    """Measures, prints and writes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bank", type=Path, default=Path("benchmarks/bank"))
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--spreads", default="0.05,0.1")
    parser.add_argument(
        "--contacts",
        type=float,
        default=0.0,
        help="standard deviation of the logarithms of stiffness and damping of contacts",
    )
    parser.add_argument("--count", type=int, default=24, help="robots of each kind and spread")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    rows = []
    for name in options.robots.split(","):
        robot = ROBOTS[name].robot()
        gaits = [commands_of(robot, options.bank, number, STEPS) for number in range(GAITS + 1)]
        for spread in map(float, options.spreads.split(",")):
            for seed in range(FIRST_SEED, FIRST_SEED + options.count):
                rows.append(measured(robot, gaits, spread, seed, options.contacts))
                print(json.dumps(rows[-1]), flush=True)
    options.out.write_text(json.dumps({"rows": rows}, indent=1) + "\n", encoding="utf-8")
    print(table(rows))


def measured(
    robot: Robot, gaits: Sequence[np.ndarray], spread: float, seed: int, contacts: float
) -> Facts:
    """Returns the facts of one physical robot; every second one has a friction of 0.8."""
    rng = np.random.default_rng([seed, round(1000 * spread)])
    truth = drawn(robot.model, spread, rng)
    if seed % 2:
        truth = replace(truth, friction=FRICTION)
    if contacts:
        other_draws = np.random.default_rng([seed, round(1000 * spread), 1])
        stiffness, damping = np.exp(contacts * other_draws.standard_normal(2)).tolist()
        # A physics step integrates no more damping than these robots have.
        truth = replace(truth, contacts=(stiffness, min(damping, 1.0)))
    seen, unseen = seed // 2 % GAITS, seed // 2 % GAITS + 1
    trial, other = (logged(robot, truth, gaits[gait], rng, "trial") for gait in (seen, unseen))
    start = process_time()
    found = calibrate(robot, [trial], threads=1)
    seconds = process_time() - start
    delayed = with_parameters(robot, replace(nominal(robot), delay=found.parameters.delay))
    off = np.log(found.parameters.factors) - np.log(truth.factors(robot.model, robot.root))
    return {
        "robot": robot.name,
        "spread": spread,
        "seed": seed,
        "chosen": found.chosen,
        "contacts_true": truth.contacts,
        "contacts": (found.parameters.contact_stiffness, found.parameters.contact_damping),
        "delay_right": found.parameters.delay == truth.delay,
        "over_deviations": (np.abs(off) / found.deviations).tolist(),
        "determined": [row["determined"] for row in found.rows()],
        "error_nominal": prediction_error(robot, [other], 1),
        "error_delayed": prediction_error(delayed, [other], 1),
        "error": prediction_error(found.robot, [other], 1),
        "suspicion": found.suspicion and str(found.suspicion),
        "seconds": seconds,
    }


@dataclass(frozen=True, eq=False)
class Truth:
    """Parameters of one physical robot, as factors of the nominal ones.

    Attributes:
        masses: Factor of the mass and inertia of each body, ``(bodies,)``.
        friction: Factor of the sliding friction.
        damping: Factor of the damping of the joints.
        gains: Factor of the torque of each motor, ``(motors,)``.
        delay: Control delay, control steps.
        noise: Noise of the log, in units of ``NOISE``.
        contacts: Factors of the stiffness and of the damping of contacts.
    """

    masses: FloatArray
    friction: float
    damping: float
    gains: FloatArray
    delay: int
    noise: float
    contacts: tuple[float, float] = (1.0, 1.0)

    def factors(self, model: mujoco.MjModel, root: str) -> FloatArray:
        """Returns the factors in the order of ``Parameters.factors``.

        The factor of the limbs is that of their total mass.
        """
        limbs = np.ones(model.nbody, dtype=bool)
        limbs[[0, model.body(root).id]] = False
        mass = model.body_mass[limbs]
        limb = float(mass @ self.masses[limbs] / mass.sum())
        root_mass = float(self.masses[model.body(root).id])
        return np.array([root_mass, limb, self.friction, self.damping, *self.gains])


def drawn(model: mujoco.MjModel, spread: float, rng: np.random.Generator) -> Truth:
    """Returns a random robot: masses, gains 1 + spread N; friction, damping 1 + 2 spread N."""
    friction, damping = 1 + 2 * spread * rng.standard_normal(2)
    return Truth(
        masses=np.maximum(0.2, 1 + spread * rng.standard_normal(model.nbody)),
        friction=float(max(0.2, friction)),
        damping=float(max(0.2, damping)),
        gains=np.maximum(0.2, 1 + spread * rng.standard_normal(model.nu)),
        delay=int(rng.integers(MAX_DELAY + 1)),
        noise=spread / 0.1,
    )


def commands_of(robot: Robot, bank: Path, number: int, steps: int) -> FloatArray:
    """Returns the commands of a gait of the bank on the nominal model, ``(steps, motors)``."""
    samples = SimulatedRobot(robot).run(bank_gait(bank, robot.name, number), steps)
    return np.asarray(collect(robot.anatomy.names, samples)["commands"])


def logged(
    robot: Robot, truth: Truth, commands: FloatArray, rng: np.random.Generator, name: str
) -> Trial:
    """Returns the noisy log of a physical robot under commands."""
    model = mujoco.MjModel.from_xml_string(robot.mjcf)
    model.body_mass *= truth.masses
    model.body_inertia *= truth.masses[:, np.newaxis]
    model.geom_friction[:, 0] *= truth.friction
    model.pair_friction[:, :2] *= truth.friction
    model.dof_damping *= truth.damping
    scale_contacts(model, *truth.contacts)
    model.actuator_gainprm *= truth.gains[:, np.newaxis]
    model.actuator_biasprm *= truth.gains[:, np.newaxis]
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    mujoco.mj_resetData(model, data)
    hinges = [model.joint(hinge) for hinge in robot.anatomy.hinges]
    positions = [int(hinge.qposadr[0]) for hinge in hinges]
    velocities = [int(hinge.dofadr[0]) for hinge in hinges]
    line = deque(np.zeros((truth.delay, model.nu)))
    states = []
    for command in commands:
        states.append((data.qpos.copy(), data.qvel.copy()))
        line.append(command)
        data.ctrl[:] = line.popleft()
        mujoco.mj_step(model, data, robot.substeps)
    qpos, qvel = (np.array(values) for values in zip(*states, strict=True))
    exact = {
        "joint_positions": qpos[:, positions],
        "joint_velocities": qvel[:, velocities],
        "base_position": qpos[:, :3],
        "base_linear_velocity": qvel[:, :3],
        "base_angular_velocity": qvel[:, 3:6],
    }
    noisy = {
        signal: values + truth.noise * NOISE[signal] * rng.standard_normal(values.shape)
        for signal, values in exact.items()
    }
    orientation = qpos[:, 3:7].copy()
    for row in orientation:
        mujoco.mju_quatIntegrate(row, truth.noise * TILT_NOISE * rng.standard_normal(3), 1.0)
    return Trial.from_arrays(
        robot,
        noisy["joint_positions"],
        commands,
        joint_velocities=noisy["joint_velocities"],
        base_position=noisy["base_position"],
        base_orientation=orientation,
        base_linear_velocity=noisy["base_linear_velocity"],
        base_angular_velocity=noisy["base_angular_velocity"],
        stage="before",
        name=name,
    )


def table(rows: Sequence[Facts]) -> str:
    """Returns the rates for each kind of robot and spread, as Markdown."""
    header = (
        "| robot | spread | robots | contacts changed | factors kept | delay right | within 68 % "
        "| within 95 % "
        "| determined factors within 68 % | within 95 % "
        "| friction of 0.8: undetermined or within 95 % | harm | harm against the delay alone "
        "| alarms | seconds |"
    )
    lines = [header, "|---" * 15 + "|"]
    for robot, spread in dict.fromkeys((row["robot"], row["spread"]) for row in rows):
        own = [row for row in rows if (row["robot"], row["spread"]) == (robot, spread)]
        over = np.array([row["over_deviations"] for row in own])
        known = np.array([row["determined"] for row in own])
        slippery = [row for row in own if row["seed"] % 2]
        column = factor_names(ROBOTS[robot].robot()).index("friction")
        honest = [
            not row["determined"][column] or row["over_deviations"][column] < 1.96
            for row in slippery
        ]
        cells = [
            robot,
            f"{spread:g}",
            str(len(own)),
            str(sum(tuple(row["contacts"]) != (1.0, 1.0) for row in own)),
            str(sum(row["chosen"] == "factors" for row in own)),
            str(sum(row["delay_right"] for row in own)),
            *_shares(over),
            *_shares(over[known]),
            f"{sum(honest)} of {len(honest)}",
            str(sum(row["error"] > HARM * row["error_nominal"] for row in own)),
            str(sum(row["error"] > HARM * row["error_delayed"] for row in own)),
            str(sum(row["suspicion"] is not None for row in own)),
            f"{np.mean([row['seconds'] for row in own]):.1f}",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _shares(over: np.ndarray) -> tuple[str, str]:
    """Returns the shares of errors within the intervals of 68 and 95 %, as text."""
    if not over.size:
        return "-", "-"
    return f"{100 * np.mean(over < 1):.0f} %", f"{100 * np.mean(over < 1.96):.0f} %"


if __name__ == "__main__":
    main()
