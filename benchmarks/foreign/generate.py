"""Generation of one recording: a healthy trial, and trials of the robot with its faults."""

import dataclasses
import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import mujoco
import numpy as np

from benchmarks.foreign.cases import CASES, Case, Faults, faults_of, notation, onset_of, stream
from benchmarks.foreign.model import LEVELS, Gap, compiled, draw_gap
from benchmarks.foreign.motion import Gait, Motion, Phase, draw_gait, simulate
from benchmarks.foreign.recorder import Encoders, Noise, encoders_of, mapping, recorded, write_bag
from benchmarks.foreign.robots import SERVO_GAINS, Robot, robot

CANDIDATES, GAITS = 16, 3
"""Drawn gaits, and gaits of a recording: those with the largest displacements."""

MATTERS = 0.1
"""Smallest change of the displacement by a fault outside all kinds, relative to the healthy one."""


@dataclass(frozen=True)
class Plan:
    """What to record: robot, case and gap by name, and the trials of the robot with its faults.

    With ``own_gait``, there are two healthy trials, and the trial of the robot with its faults has
    another gait: a trot for every second seed (of the Go2, which trots, a walk).
    """

    robot: str
    case: str
    seed: int
    gap: str
    duration: float = 10.0
    trials: int = 3
    own_gait: bool = False

    @property
    def name(self) -> str:
        """Name of the folder of the recording."""
        return f"{self.robot}-{self.case}-{self.seed}-{self.gap}{'-own' * self.own_gait}"

    def stream(self, *words: str) -> np.random.Generator:
        """Returns a random stream of this robot and case."""
        return stream(self.seed, self.robot, self.case, *words)


def generate(out: Path, plan: Plan) -> Path:
    """Writes a recording: bags, mappings and ``truth.json``, the last; returns its folder."""
    folder = out / plan.name
    written, asked = folder / "truth.json", dataclasses.asdict(plan)
    if written.exists() and asked.items() <= json.loads(written.read_text()).items():
        return folder
    machine, case = robot(plan.robot), CASES[plan.case]
    faults, onset = faults_of(case, machine, plan.seed), onset_of(case, machine, plan.seed)
    if onset is not None and onset >= plan.duration:
        raise SystemExit(f"{plan.name}: expected a --duration above the onset, {onset:g} s")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    gap = draw_gap(machine, LEVELS[plan.gap], plan.stream("gap"))
    gaits = _gaits(machine, case, plan, faults)
    record = partial(_record, folder, machine, plan, gap)
    before = record(name="before", faults=(), onset=None, gait=gaits[0])
    if plan.own_gait:
        record(name="before-2", faults=(), onset=None, gait=gaits[1])
        gaits = [_trot(machine, plan) if plan.seed % 2 else gaits[2]]
    moved: list[Motion] = []
    for k in range(plan.trials):
        # Trials after the onset have the faults from their start.
        present = _stated(machine, faults, moved) if moved else faults
        start = None if k else onset
        moved.append(record(name=f"after-{k + 1}", faults=present, onset=start, gait=gaits[k]))
    if machine.mapped_as != machine.name:  # the MJCF beside the mappings, with its settings
        shutil.copyfile(machine.path, folder / machine.mapped_as)
    if machine.name == "ant":
        stiffness, damping = SERVO_GAINS
        settings = f"kp = {stiffness}\nkd = {damping}\n"
        (folder / machine.mapped_as).with_suffix(".toml").write_text(settings)
    write_truth(written, plan, _stated(machine, faults, moved), onset, [before, moved[0]])
    return folder


def write_truth(
    path: Path, plan: Plan, faults: Faults, onset: float | None, motions: Sequence[Motion]
) -> None:
    """Writes what was asked and what is true, and how far the robot went before and after."""
    healthy, after = (motion.displacement(plan.duration).tolist() for motion in motions)
    truth = {
        **dataclasses.asdict(plan),
        "group": CASES[plan.case].group,
        "truth": notation(faults),
        "faults": [dataclasses.asdict(fault) for fault in faults],
        "onset": onset,
        "displacement_healthy": healthy,
        "displacement_after": after,
    }
    path.write_text(json.dumps(truth, indent=1) + "\n")


def _stated(machine: Robot, faults: Faults, motions: list[Motion]) -> Faults:
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


def phase_of(
    start: float, machine: Robot, faults: Faults, model: Callable[..., mujoco.MjModel]
) -> Phase:
    """Returns a phase of a trial with the effects of the faults outside the model."""

    def of_kind(kind: str) -> Faults:
        return tuple(fault for fault in faults if fault.kind == kind)

    return Phase(
        start=start,
        model=model,
        offsets={machine.part(f.part).hinges[0]: f.value for f in of_kind("encoder-slip")},
        fixed={h: f.value for f in of_kind("jam") for h in machine.part(f.part).hinges},
        dead=frozenset(fault.part for fault in of_kind("dead-sensor")),
        swapped=tuple(name for fault in of_kind("crossed") for name in fault.part.split()),
        delay=machine.control_timestep * sum(fault.value for fault in of_kind("delay")),
    )


def _gaits(machine: Robot, case: Case, plan: Plan, faults: Faults) -> list[Gait]:
    """Returns the gaits with the largest displacements of the robot without gap and faults."""
    rng = plan.stream("gaits")
    wrong = "sensor" in case.name  # so that a network has to control the robot
    kind = "network" if wrong or rng.random() < 1 / 3 else "playback"
    kind = kind if machine.has_odometry else "stride"
    gaits = [draw_gait(machine, kind, rng) for _ in range(CANDIDATES)]
    return by_displacement(machine, plan, gaits, faults if case.group == "outside" else ())[:GAITS]


def by_displacement(
    machine: Robot, plan: Plan, gaits: list[Gait], outside: Faults = ()
) -> list[Gait]:
    """Returns gaits by their displacement of the robot without gap and faults, the largest first.

    Of those at the front, gaits that faults outside all kinds hardly change are last.
    """
    perfect = draw_gap(machine, 0.0, plan.stream("gap"))

    def moved(model: mujoco.MjModel, gait: Gait, present: Faults) -> Motion:
        phase = phase_of(0.0, machine, present, lambda _angles: model)
        return simulate(machine, [phase], gait, plan.duration)

    model = compiled(machine, perfect, ())
    motions = [moved(model, gait, ()) for gait in gaits]
    ways = [motion.displacement(plan.duration) for motion in motions]
    distances = [
        float(np.linalg.norm(way)) * (1.0 if motion.is_upright() else 0.01)
        for way, motion in zip(ways, motions, strict=True)
    ]
    best = sorted(range(len(gaits)), key=lambda k: -distances[k])
    if outside:
        other = compiled(machine, perfect, outside)

        def is_unaffected(k: int) -> bool:
            after = moved(other, gaits[k], outside).displacement(plan.duration)
            return bool(np.linalg.norm(after - ways[k]) / np.linalg.norm(ways[k]) < MATTERS)

        best = sorted(best[: 2 * GAITS], key=is_unaffected)
    return [gaits[k] for k in best]


def _trot(machine: Robot, plan: Plan) -> Gait:
    """Returns the trot with the largest displacement of the robot without gap and faults."""
    rng, kind = plan.stream("trot"), "trot" if machine.has_odometry else "walk"
    return by_displacement(machine, plan, [draw_gait(machine, kind, rng) for _ in range(GAITS)])[0]


def _record(
    folder: Path,
    machine: Robot,
    plan: Plan,
    gap: Gap,
    *,
    name: str,
    faults: Faults,
    onset: float | None,
    gait: Gait,
) -> Motion:
    """Simulates and records one trial, and writes its mapping."""
    rng = plan.stream(plan.gap, name)
    delay, spread = gap.latency
    models = partial(compiled, machine, gap)
    phases = [phase_of(onset or 0.0, machine, faults, partial(models, faults))]
    if onset is not None:
        phases = [phase_of(0.0, machine, (), partial(models, ())), *phases]
    motion = simulate(
        machine, phases, gait, plan.duration, lambda: delay + spread * rng.uniform(-1, 1)
    )
    turned = plan.stream("signs").choice((-1, 1), len(machine.hinges))
    signs = {hinge: int(sign) for hinge, sign in zip(machine.hinges, turned, strict=True)}
    encoders = encoders_of(machine, faults, onset or -1.0, signs)
    write_trial(folder / name, plan, machine, motion, encoders=encoders, rng=rng)
    return motion


def write_trial(
    path: Path,
    plan: Plan,
    machine: Robot,
    motion: Motion,
    *,
    encoders: Encoders,
    rng: np.random.Generator,
) -> None:
    """Writes the bag of a trial, and its mapping beside it."""
    noise = Noise().scaled(LEVELS[plan.gap])
    items = recorded(machine, motion, encoders, noise, rng)
    write_bag(path, items, noise.lost, rng, mcap=plan.seed % 2 == 0)
    text = mapping(machine, encoders, plan.duration, healthy=path.name.startswith("before"))
    path.with_suffix(".toml").write_text(text)
