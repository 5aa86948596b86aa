"""Generation of one recording: a healthy trial, and trials of the robot with its faults."""

import dataclasses
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import mujoco
import numpy as np

from benchmarks.foreign.cases import CASES, Case, faults_of, onset_of
from benchmarks.foreign.faults import Fault, notation
from benchmarks.foreign.recorder.bag import Noise, recorded_items, write_bag
from benchmarks.foreign.recorder.encoders import encoders_of
from benchmarks.foreign.recorder.mapping import mapping
from benchmarks.foreign.robots import SERVO_GAINS, Robot, robot
from benchmarks.foreign.seeds import stream
from benchmarks.foreign.world.body import compiled
from benchmarks.foreign.world.gaits import Gait, command_ranges, draw_gait, upright
from benchmarks.foreign.world.gap import LEVELS, Gap, draw_gap
from benchmarks.foreign.world.motion import Motion, Phase, simulate

CANDIDATES, GAITS = 16, 3
"""Drawn gaits, and gaits of a recording: those with the largest displacements."""

NO_GAP = 0.0
MATTERS = 0.1
"""Smallest change of the displacement by a fault outside all kinds, relative to the healthy one."""


@dataclass(frozen=True)
class Plan:
    """What to record.

    Attributes:
        robot: Name of the robot.
        case: Name of the case.
        seed: Seed.
        gap: Name of the gap.
        duration: Duration of each trial, s.
        trials: Number of trials of the robot with its faults.
    """

    robot: str
    case: str
    seed: int
    gap: str
    duration: float = 10.0
    trials: int = 3

    @property
    def name(self) -> str:
        """Name of the folder of the recording."""
        return f"{self.robot}-{self.case}-{self.seed}-{self.gap}"


@dataclass(frozen=True)
class Trial:
    """One trial of a recording.

    Attributes:
        name: Name of its bag.
        faults: The faults.
        onset: Time at which they begin, s; None if they hold from the start.
        gait: The gait.
    """

    name: str
    faults: tuple[Fault, ...]
    onset: float | None
    gait: Gait


def generate(out: Path, plan: Plan) -> Path:
    """Writes a recording: bags, mappings and ``truth.json``, which is written last.

    Returns:
        Its folder.
    """
    folder = out / plan.name
    made, asked = folder / "truth.json", dataclasses.asdict(plan)
    if made.exists() and asked.items() <= json.loads(made.read_text()).items():
        return folder
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    machine, case = robot(plan.robot), CASES[plan.case]
    faults = faults_of(case, machine, plan.seed)
    onset = onset_of(case, machine, plan.seed)
    gap = draw_gap(machine, LEVELS[plan.gap], _stream(plan, "gap"))
    gaits = _gaits(machine, case, plan, faults)
    record = partial(_record, folder, machine, plan, gap)
    before = record(Trial("before", (), None, gaits[0]))
    moved: list[Motion] = []
    for k in range(plan.trials):
        # Trials after the onset have the faults from their start.
        start = onset if k == 0 else None
        present = _stated(machine, faults, moved) if moved else faults
        moved.append(record(Trial(f"after-{k + 1}", present, start, gaits[k])))
    if machine.mapped_as != machine.name:
        _write_files(machine, folder)
    stated = _stated(machine, faults, moved)
    truth = {
        **dataclasses.asdict(plan),
        "group": case.group,
        "truth": notation(stated),
        "faults": [dataclasses.asdict(fault) for fault in stated],
        "onset": onset,
        "displacement_healthy": before.displacement(plan.duration).tolist(),
        "displacement_after": moved[0].displacement(plan.duration).tolist(),
    }
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
    return folder


def _stream(plan: Plan, *words: str) -> np.random.Generator:
    return stream(plan.seed, plan.robot, plan.case, *words)


def _stated(machine: Robot, faults: tuple[Fault, ...], motions: list[Motion]) -> tuple[Fault, ...]:
    """Returns the faults, a jam where the joint was at the onset with its angle."""

    def angle(part: str) -> float:
        hinge = machine.hinges.index(machine.part(part).hinges[0])
        return round(float(motions[0].angles[-1, hinge]), 4)

    return tuple(
        dataclasses.replace(fault, value=angle(fault.part))
        if fault.kind == "jam" and np.isnan(fault.value)
        else fault
        for fault in faults
    )


def _phase(
    start: float, machine: Robot, faults: tuple[Fault, ...], model: Callable[..., mujoco.MjModel]
) -> Phase:
    """Returns a phase of a trial with the effects of the faults outside the model."""
    return Phase(
        start=start,
        model=model,
        offsets={
            machine.part(fault.part).hinges[0]: fault.value
            for fault in faults
            if fault.kind == "encoder-slip"
        },
        fixed={
            hinge: fault.value
            for fault in faults
            if fault.kind == "jam"
            for hinge in machine.part(fault.part).hinges
        },
        dead=frozenset(fault.part for fault in faults if fault.kind == "dead-sensor"),
        swapped=next((tuple(f.part.split()) for f in faults if f.kind == "crossed"), ()),
        delay=machine.control_timestep * sum(f.value for f in faults if f.kind == "delay"),
    )


def _write_files(machine: Robot, folder: Path) -> None:
    """Writes the MJCF beside the mappings, with its settings."""
    shutil.copyfile(machine.path, folder / machine.mapped_as)
    stiffness, damping = SERVO_GAINS
    settings = f"kp = {stiffness}\nkd = {damping}\n"
    (folder / machine.mapped_as).with_suffix(".toml").write_text(settings)


def _gaits(machine: Robot, case: Case, plan: Plan, faults: tuple[Fault, ...]) -> list[Gait]:
    """Returns the gaits with the largest displacements of the robot without gap and faults."""
    rng, ranges = _stream(plan, "gaits"), command_ranges(machine)
    kind = "network" if case.network or rng.random() < 1 / 3 else "playback"
    drawn = [draw_gait(machine, ranges, kind, rng) for _ in range(CANDIDATES)]
    perfect = draw_gap(machine, NO_GAP, _stream(plan, "gap"))
    model = compiled(machine, perfect, ())
    motions = [_rehearsal(machine, model, gait, (), plan.duration) for gait in drawn]
    distances = [
        float(np.linalg.norm(motion.displacement(plan.duration)))
        * (1.0 if upright(motion.pose[-1, 3:]) else 0.01)
        for motion in motions
    ]
    best = sorted(range(CANDIDATES), key=lambda k: -distances[k])
    if case.group == "outside":
        other = compiled(machine, perfect, faults)
        best = sorted(
            best[: 2 * GAITS],
            key=lambda k: (
                _change(
                    motions[k], _rehearsal(machine, other, drawn[k], faults, plan.duration), plan
                )
                < MATTERS
            ),
        )
    return [drawn[k] for k in best[:GAITS]]


def _change(before: Motion, after: Motion, plan: Plan) -> float:
    healthy = before.displacement(plan.duration)
    return float(
        np.linalg.norm(after.displacement(plan.duration) - healthy) / np.linalg.norm(healthy)
    )


def _rehearsal(
    machine: Robot, model: mujoco.MjModel, gait: Gait, faults: tuple[Fault, ...], duration: float
) -> Motion:
    return simulate(machine, [_phase(0.0, machine, faults, lambda _angles: model)], gait, duration)


def _record(folder: Path, machine: Robot, plan: Plan, gap: Gap, trial: Trial) -> Motion:
    """Simulates and records one trial, and writes its mapping."""
    rng = _stream(plan, plan.gap, trial.name)

    def latency() -> float:
        return gap.latency + gap.latency_spread * rng.uniform(-1, 1)

    models = partial(compiled, machine, gap)
    start = trial.onset or 0.0
    phases = [_phase(start, machine, trial.faults, partial(models, trial.faults))]
    if trial.onset is not None:
        phases = [_phase(0.0, machine, (), partial(models, ())), *phases]
    motion = simulate(machine, phases, trial.gait, plan.duration, latency)
    turned = _stream(plan, "signs").choice((-1, 1), len(machine.hinges))
    signs = {hinge: int(sign) for hinge, sign in zip(machine.hinges, turned, strict=True)}
    encoders = encoders_of(machine, trial.faults, trial.onset or -1.0, signs)
    write_bag(
        folder / trial.name,
        recorded_items(machine, motion, encoders, Noise().scaled(gap.size), rng),
        rng,
        lost=Noise().lost * gap.size,
        mcap=plan.seed % 2 == 0,
    )
    text = mapping(machine, encoders, plan.duration, healthy=not trial.name.startswith("after"))
    (folder / f"{trial.name}.toml").write_text(text)
    return motion
