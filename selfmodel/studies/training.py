"""Policies evolved for a task of dm_control's suite: its own observation, return and episodes.

The search is ``EvolutionStrategy``, over episodes that are shorter than those of the task. The
observation is normalised by its mean and its deviation in all episodes so far (Mania et al.,
arXiv:1803.07055). The state of a training is one file, written after each generation, from which
the same training goes on to the bit.
"""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from selfmodel import evolution
from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.controllers.controller import TASK_PREFIX, Controller
from selfmodel.controllers.graph import layers
from selfmodel.controllers.policy import Policy
from selfmodel.controllers.trained import Trained, initial_layers
from selfmodel.errors import InputError, check_name, typed
from selfmodel.evolution import Generation
from selfmodel.faults.build import build
from selfmodel.faults.notation import parse
from selfmodel.files import path_of, read_file
from selfmodel.logs.controllers import NPZ_FAILURES, npz_bytes, read_arrays
from selfmodel.logs.files import make_folder, refuse_existing, replace_file
from selfmodel.logs.policies import Commanded, Observed, PolicyFile, policy_of
from selfmodel.progress import ignore
from selfmodel.recovery.evolution_strategy import EvolutionStrategy
from selfmodel.robot.actuators import command_ranges
from selfmodel.robot.observations import Fields, observation_of, observation_width
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.simulation.rollout import Rollout
from selfmodel.simulation.simulator import thread_count
from selfmodel.tasks import suite_bodies
from selfmodel.tasks.rewards import REWARDS, Starts, reward_of
from selfmodel.tasks.suite_bodies import EPISODE
from selfmodel.tasks.suite_tasks import check_effect

SPAN = 10.0
"""Largest change of a weight from that of the first network."""

LEAST_SPREAD = 0.01
"""Smallest standard deviation that a number of the observation is divided by."""

POLICY, NETWORK, STATE, PROGRESS = "policy.toml", "policy.npz", "state.npz", "progress.csv"
"""Files of a training."""


@typed
@dataclass(frozen=True)
class TrainingSettings:
    """What determines a training, besides its task.

    Attributes:
        hidden: Hidden neurons of the network; 0 for a linear one.
        pairs: Pairs of opposite policies of a generation, each with one episode.
        deviation: Standard deviation of the weights of a generation about their mean.
        rate: Largest step of the mean of the weights.
        steps: Control steps of an episode of the training.
        damage: Faults of the body, in notation.
        seed: Seed of all random numbers.
    """

    hidden: int = 0
    pairs: int = 16
    deviation: float = 0.1
    rate: float = 0.05
    steps: int = 500
    damage: str = "intact"
    seed: int = 0


@dataclass
class Moments:
    """Count, mean and mean square deviation of observations, ``(width,)``."""

    count: float
    mean: FloatArray
    square: FloatArray

    def add(self, rows: int, shifted: FloatArray, squares: FloatArray) -> None:
        """Adds rows by the sums of their differences from the mean, and of the squares of these."""
        total, step = self.count + rows, shifted / (self.count + rows)
        self.square = (self.count * self.square + squares) / total - step**2
        self.mean, self.count = self.mean + step, total

    @property
    def spread(self) -> FloatArray:
        """Standard deviation; 1 without an observation."""
        return np.maximum(np.sqrt(self.square), LEAST_SPREAD)


class Training:
    """An evolution of a policy for a task, such as ``suite-walker-walk``, by generations.

    Raises:
        InputError: The task has no observation or reward that a policy is evolved for, or the body
            cannot have the damage.
    """

    def __init__(self, robot: str, settings: TrainingSettings, threads: int = 1) -> None:
        self.name, self.settings = robot, settings
        self._robot, parts = _body(robot)
        self._threads = threads
        damage = parse(settings.damage, self._robot.anatomy)
        check_effect(robot, damage)
        self._variant = build(self._robot, damage)
        self._reward, self._starts = reward_of(*parts), Starts(*parts)
        self._rng = np.random.default_rng(settings.seed)
        key = observation_of(robot)
        self._observation = f"{TASK_PREFIX}{key}"
        width = observation_width(key, self._robot.model)
        self._moments = Moments(0.0, np.zeros(width), np.ones(width))
        motors = len(self._robot.anatomy.motors)
        self._first = layers(
            initial_layers(width, settings.hidden, motors, self._rng), "Tanh", "Tanh"
        )
        self._search = EvolutionStrategy(
            self._first.weights,
            Settings(),
            self._rng,
            start=np.zeros(self._first.weights),
            pairs=settings.pairs,
            deviation=settings.deviation / SPAN,
            rate=settings.rate / SPAN,
        )
        self.rows: list[tuple[float, ...]] = []
        self._seconds, self._clock = 0.0, process_time()

    @property
    def generation(self) -> int:
        """Generations so far."""
        return self._search.generation

    @property
    def file(self) -> PolicyFile:
        """The policy file, with the normalisation so far."""
        own, ranges = self._moments, command_ranges(self._robot.model)
        seen = Observed("task", tuple(1 / own.spread), tuple(own.mean))
        action = Commanded(tuple(half for _, half in ranges), tuple(mid for mid, _ in ranges))
        return PolicyFile(
            NETWORK, activation="Tanh", last="Tanh", observation=(seen,), action=action
        )

    @property
    def design(self) -> Trained:
        """The design of the policies of the next generation."""
        policy = policy_of(self.file, self._first, self._robot)
        own = {name: getattr(policy, name) for name in ("sensors", "motors", "ranges", "interface")}
        return Trained(**own, graph=self._first, span=SPAN)

    @property
    def policy(self) -> Policy:
        """The policy of the mean of the search."""
        return self.design.policy(self._search.mean)

    def run(self, generations: int, after: Callable[[Generation], None] = ignore) -> None:
        """Runs further generations, and calls ``after`` with each."""
        if generations > 0:
            end = self.generation + generations
            loop = (self._search, self._fitness, after, lambda: end - self.generation)
            evolution.evolve(*loop, noisy=True)

    def _fitness(self, genomes: FloatArray) -> FloatArray:
        """Returns the returns of genomes; the two of a pair have the same initial state."""
        seeds = np.tile(self._rng.integers(2**32, size=len(genomes) // 2), 2)
        design = self.design
        controllers = [Controller(design, one) for one in genomes]
        found = self.returns(controllers, seeds, self.settings.steps, learn=True)
        finite = found[np.isfinite(found)]
        now = process_time()
        self._seconds, self._clock = self._seconds + now - self._clock, now
        count, own = self._search.generation + 1, self.settings.steps
        steps, scale = count * len(genomes) * own, EPISODE / own
        mean, most = (finite.mean(), finite.max()) if len(finite) else (math.nan,) * 2
        self.rows.append((count, steps, self._seconds, float(scale * mean), float(scale * most)))
        return found

    def returns(
        self,
        controllers: Sequence[Controller],
        seeds: IndexArray,
        steps: int | None = None,
        *,
        learn: bool = False,
    ) -> FloatArray:
        """Returns the return of an episode of each controller, ``(n,)``; -infinity if it diverged.

        The controllers are policies of one design, and the seeds those of each initial state, as
        ``random`` of the suite's environment. An episode has the steps of the task's if none are
        given. With ``learn``, the observations count in the normalisation.
        """
        robot, count = self._robot, len(controllers)
        start, speeds = self._starts.draw(seeds)
        variants = [self._variant] * count
        rollout = Rollout(
            robot, variants, controllers, (), threads=self._threads, start=start, speeds=speeds
        )
        fields = Fields(robot.model, rollout.bind)
        commands = np.zeros((count, len(robot.anatomy.motors)))
        self._reward(fields, commands)  # binds its fields before the first step
        total, own = np.zeros(count), self._moments
        shifted, squares = np.zeros((2, count, len(own.mean)))
        steps = EPISODE if steps is None else steps
        for k in rollout.steps(steps + 1):
            if k:
                total += self._reward(fields, commands)
            commands[:] = rollout.live["commands"]()
            difference = rollout.observed[self._observation] - own.mean
            shifted += difference
            squares += difference**2
        finite = np.isfinite(total) & ~rollout.diverged()
        if learn and finite.any():
            rows = int(finite.sum()) * (steps + 1)
            own.add(rows, shifted[finite].sum(axis=0), squares[finite].sum(axis=0))
        return np.where(finite, total, -math.inf)

    def judged(self, episodes: int) -> FloatArray:
        """Returns the returns of the policy in episodes that no training has, ``(episodes,)``."""
        seeds = np.arange(2**32 - episodes, 2**32)
        return self.returns([Controller(self.policy, np.zeros(0))] * episodes, seeds)

    # ---------------------------------------------------------------- files

    def save(self, folder: Path) -> None:
        """Writes the policy, the progress and the state; each file is whole at any time."""
        design = self.design
        tensors = {name: one[0] for name, one in design.tensors(self._search.mean[None]).items()}
        about = {"robot": self.name, **asdict(self.settings), "seconds": self._seconds}
        about |= {"rng": self._rng.bit_generator.state}
        state = {
            **self._arrays,
            "rows": np.array(self.rows),
            "about": np.array(json.dumps(about)),
        }
        table = "".join(f"{','.join(map(str, row))}\n" for row in (COLUMNS, *self.rows))
        for name, content in (
            (NETWORK, npz_bytes(tensors)),
            (POLICY, _policy_text(self.file).encode()),
            (PROGRESS, table.encode()),
            (STATE, npz_bytes(state)),
        ):
            replace_file(folder / name, content)

    @property
    def _arrays(self) -> dict[str, FloatArray]:
        """Arrays of the state, besides the progress; their shapes are those of the task."""
        own = self._moments
        average = {"count": np.array(own.count), "average": own.mean, "square": own.square}
        return {**self._search.state(), **average}

    def resume(self, path: Path) -> None:
        """Continues from a state file.

        Raises:
            InputError: The file is of another training, or none.
        """
        data = read_file(path, "the state of a training", MAX_STATE_BYTES)
        mine = {"robot": self.name, **asdict(self.settings)}
        try:
            found = read_arrays(data, MAX_STATE_BYTES)
            about = {"steps": EPISODE, "damage": "intact", **json.loads(str(found["about"]))}
            differ = [OPTIONS.get(name, name) for name in mine if about.get(name) != mine[name]]
            if not differ:
                self._continue(found, about)
        except NPZ_FAILURES as error:
            reason = f"{type(error).__name__}: {error}"
            raise InputError(f"{path}: expected the state of a training: {reason}") from error
        if differ:
            raise InputError(
                f"{path} is of a training with another {', '.join(differ)}: give its options, or "
                f"another folder"
            )

    def _continue(self, found: Mapping[str, Any], about: Mapping[str, Any]) -> None:
        for name, own in self._arrays.items():
            if found[name].shape != own.shape or not np.isfinite(found[name]).all():
                raise ValueError(f"{name} is not {own.shape} finite numbers")
        self.rows = [(int(k), int(steps), *own) for k, steps, *own in found["rows"].tolist()]
        self._rng.bit_generator.state = about["rng"]
        self._seconds = float(about["seconds"])
        self._moments = Moments(float(found["count"]), found["average"], found["square"])
        self._search.resume(found)


OPTIONS = {"hidden": "neurons", "pairs": "population"}
"""Options of the command line that settings are given by, where the names differ."""

MAX_STATE_BYTES = 2**30
"""Largest state of a training."""

COLUMNS = ("generation", "steps", "cpu_seconds", "mean_return", "best_return")
"""Columns of the progress."""


def _body(name: str) -> tuple[Robot, tuple[str, str]]:
    known = {
        suite_bodies.name(*parts): parts for parts in suite_bodies.BODIES if parts[0] in REWARDS
    }
    known = {body: parts for body, parts in known.items() if observation_of(body)}
    check_name("task that policies are evolved for", name, known)
    return suite_bodies.robot(*known[name]), known[name]


def _policy_text(file: PolicyFile) -> str:
    """Returns a policy file as TOML."""
    (seen,) = file.observation
    tables: dict[str, dict[str, Any]] = {
        "": {"network": file.network, "activation": file.activation, "last": file.last},
        "[[observation]]": {"term": seen.term, "scale": seen.scale, "offset": seen.offset},
        "[action]": {"scale": file.action.scale, "offset": file.action.offset},
    }
    blocks = (
        "\n".join([heading, *(f"{key} = {json.dumps(value)}" for key, value in table.items())])
        for heading, table in tables.items()
    )
    return "\n\n".join(blocks).lstrip() + "\n"


@typed
def evolve_policy(
    robot: str,
    folder: Path,
    settings: TrainingSettings,
    *,
    generations: int,
    threads: int = 0,
    on_event: Callable[[Generation], None] = ignore,
) -> Training:
    """Evolves a policy for a task into a folder, or goes on with that in it.

    Args:
        robot: Name of a body of the suite, such as ``suite-walker-walk``.
        folder: Gets the policy, ``policy.toml`` and its network, the state and the progress.
        settings: What determines the training.
        generations: Generations in all, those in the folder included.
        threads: Threads of the physics; 0 for all processors.
        on_event: Called after each generation.

    Raises:
        InputError: The task is unknown, or the folder has another training, or a policy of another
            source.
    """
    training = Training(robot, settings, thread_count(threads))
    folder = path_of(folder, "a folder")
    make_folder(folder)
    if (folder / STATE).exists():
        training.resume(folder / STATE)
    else:
        for name in (POLICY, NETWORK):
            refuse_existing(folder / name)

    def after(generation: Generation) -> None:
        training.save(folder)
        on_event(generation)

    training.run(generations - training.generation, after)
    return training
