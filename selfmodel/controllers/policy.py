"""Policies: trained networks that walk a robot, from observations to the targets of its motors.

A policy is what laboratories train by reinforcement learning: a network from an observation, a row
of terms such as the direction of gravity and the joint velocities, to an action, from which the
targets of the motors follow by a scale and an offset. Nothing of it is evolved: its genome is
empty. ``compensation.Compensated`` is a layer around it that is.
"""

import math
from collections.abc import Callable, Mapping, Sequence, Set as AbstractSet
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.controllers.controller import TASK_PREFIX, Design
from selfmodel.controllers.function import Function
from selfmodel.controllers.graph import Graph
from selfmodel.errors import check_name
from selfmodel.rotation import directions, in_body_frame

VELOCITY = 3
"""Numbers of a commanded velocity: forward and to the left, m/s, and the turn to the left, rad/s.
"""

MEASURED: Mapping[str, tuple[tuple[str, ...], Callable[..., FloatArray]]] = {
    "linear_velocity": (("base_linear_velocity", "base_orientation"), in_body_frame),
    "angular_velocity": (("base_angular_velocity",), np.asarray),
    "gravity": (("base_orientation",), lambda turn: -directions(turn)[:, 2:]),
    "joint_positions": (("joint_positions",), np.asarray),
    "joint_velocities": (("joint_velocities",), np.asarray),
}
"""Terms that a robot measures: the signals they need, and their values from these; vectors are in
the frame of the base."""

MAX_HISTORY, MIN_PERIOD = 1000, 1e-3
"""Longest history, observations, and shortest period of a clock, s."""

JOINT_TERMS = ("joint_positions", "joint_velocities")
"""Terms with one number per joint of the policy; positions are relative to its pose."""

INTERNAL = ("last_action", "velocity", "phase", "sensors")
"""Other terms: the network's last output, the commanded velocity, sine and cosine of the phase of a
clock, and the readings of the paper's sensors."""

TASK = "task"
"""Term that is the observation of a task of dm_control's suite."""

TERMS = (*MEASURED, *INTERNAL, TASK)
"""Every term of an observation."""


@dataclass(frozen=True)
class Term:
    """One term of an observation: ``(value - offset) * scale``.

    Attributes:
        name: One of ``TERMS``.
        scale: A factor for all its numbers, or one for each.
        offset: What is subtracted first; one number, or one for each.
    """

    name: str
    scale: tuple[float, ...] = (1.0,)
    offset: tuple[float, ...] = (0.0,)


@dataclass(frozen=True, kw_only=True)
class Action:
    """How the targets of the motors follow from the output of a network.

    target = offset + scale * output, within the command range of the motor.

    Attributes:
        motors: Motors of the outputs, in the order of the network; others keep their holding
            commands.
        scale: Target per output, ``(motors,)``, in the motor's unit.
        offset: Target for an output of 0, ``(motors,)``.
        clip: Largest absolute output, also as the last action; larger ones are this large.
    """

    motors: tuple[str, ...]
    scale: tuple[float, ...]
    offset: tuple[float, ...]
    clip: float | None = None


@dataclass(frozen=True, kw_only=True)
class Interface:
    """What a policy observes of a robot, and what it commands.

    Attributes:
        terms: Terms of the observation, in order.
        action: Targets from the output of the network.
        hinges: Hinges of the robot, in the order of its signals.
        joints: Hinges of the joints' terms, in the order of the network.
        pose: Position of each of them that counts as 0, ``(joints,)``, rad.
        holding: Commands of the robot's motors that hold its initial pose, ``(motors,)``.
        timestep: Control time step, s.
        velocity: Commanded velocity, ``(3,)``.
        history: Number of last observations that the network receives; those before the trial are
            the first one.
        by_term: Whether a history is stacked term by term, as in Isaac Lab, and not as a whole.
        newest_first: Whether a history begins with the newest observation.
        decimation: Control steps per evaluation of the network.
        period: Period of the clock of the term ``phase``, s.
        task: Observation of the term ``task``, such as ``walker``; "" without it.
        task_width: Its numbers.
    """

    terms: tuple[Term, ...]
    action: Action
    hinges: tuple[str, ...]
    joints: tuple[str, ...]
    pose: tuple[float, ...]
    holding: tuple[float, ...]
    timestep: float
    velocity: tuple[float, ...] = (0.0, 0.0, 0.0)
    history: int = 1
    by_term: bool = False
    newest_first: bool = False
    decimation: int = 1
    period: float = 1.0
    task: str = ""
    task_width: int = 0


@dataclass(frozen=True)
class Policy(Design):
    """A trained network, or a function, with what it observes and commands; its genome is empty.

    Raises:
        ValueError: The network does not have as many inputs or outputs as the terms and the motors
            have numbers, a name is unknown, or a number of numbers is wrong.
    """

    name: ClassVar[str] = "policy"

    graph: Graph | Function = field(kw_only=True)
    interface: Interface = field(kw_only=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        own, action = self.interface, self.interface.action
        counts = (
            ("pose", own.pose, len(own.joints)),
            ("velocity", own.velocity, VELOCITY),
            ("holding", own.holding, len(self.motors)),
            ("action's scale", action.scale, len(action.motors)),
            ("action's offset", action.offset, len(action.motors)),
        )
        for what, given, count in counts:
            if len(given) != count:
                raise ValueError(f"expected {count} numbers of its {what}, got {len(given)}")
        names = (("joint", own.joints, own.hinges), ("motor", action.motors, self.motors))
        for what, chosen, known in names:
            for name in chosen:
                check_name(what, name, known)
            if len(set(chosen)) < len(chosen):
                raise ValueError(f"it names a {what} twice")
        if not (1 <= own.history <= MAX_HISTORY and own.decimation >= 1):
            raise ValueError(f"expected a history of 1 to {MAX_HISTORY}, and a decimation above 0")
        if not (own.timestep > 0 and own.period >= MIN_PERIOD):
            raise ValueError(f"expected a step above 0 s, and a period of {MIN_PERIOD:g} s or more")
        self._check_terms()
        self._check_network()

    def _check_terms(self) -> None:
        if not self.interface.terms:
            raise ValueError("expected a preset or terms of an observation, got none")
        for term in self.interface.terms:
            check_name("term", term.name, TERMS)
            for numbers in (term.scale, term.offset):
                if len(numbers) not in (1, self.width(term.name)):
                    raise ValueError(
                        f"expected 1 or {self.width(term.name)} numbers of the term {term.name}, "
                        f"got {len(numbers)}"
                    )

    def _check_network(self) -> None:
        own, motors = self.interface, len(self.interface.action.motors)
        if self.graph.outputs != motors:
            raise ValueError(
                f"the network has {self.graph.outputs} outputs, and there are {motors} motors: "
                f"name those that it commands, in its order, as motors of action"
            )
        size = self.inputs
        if isinstance(self.graph, Graph) and self.graph.inputs != size:
            widths = ", ".join(f"{term.name} {self.width(term.name)}" for term in own.terms)
            times = f", {own.history} times" if own.history > 1 else ""
            raise ValueError(
                f"the network has {self.graph.inputs} inputs, and its terms {size} ({widths}"
                f"{times}): give those of its training, and its history"
            )

    @property
    def inputs(self) -> int:
        """Numbers of an observation."""
        return self.interface.history * sum(self.width(term.name) for term in self.interface.terms)

    def width(self, term: str) -> int:
        """Numbers of a term."""
        own = {"last_action": self.graph.outputs, "phase": 2, "sensors": len(self.sensors)}
        own |= {TASK: self.interface.task_width}
        return len(self.interface.joints) if term in JOINT_TERMS else own.get(term, 3)

    @property
    def reads(self) -> bool:
        """Whether a term is of the readings."""
        return any(term.name == "sensors" for term in self.interface.terms)

    @property
    def observes(self) -> tuple[str, ...]:
        """Signals of the robot that the terms need, besides the readings."""
        known = {name: signals for name, (signals, _) in MEASURED.items()}
        known[TASK] = (f"{TASK_PREFIX}{self.interface.task}",)
        needed = (known[term.name] for term in self.interface.terms if term.name in known)
        return tuple(dict.fromkeys(signal for signals in needed for signal in signals))

    @property
    def neutral(self) -> tuple[float, ...]:
        """Commands for an output of 0."""
        action, holding = self.interface.action, self.interface.holding
        of_motor = dict(zip(action.motors, action.offset, strict=True))
        return tuple(
            of_motor.get(name, held) for name, held in zip(self.motors, holding, strict=True)
        )

    @property
    def velocity(self) -> tuple[float, ...] | None:
        """That of its interface, if it observes it."""
        observed = any(term.name == "velocity" for term in self.interface.terms)
        return self.interface.velocity if observed else None

    @property
    def weights(self) -> int:
        """No weight is evolved."""
        return 0

    @property
    def description(self) -> str:
        """Numbers of observations, motors and weights as text."""
        graph, motors = self.graph, len(self.interface.action.motors)
        of = (
            f"{graph.weights} weights" if isinstance(graph, Graph) else f"the function {graph.name}"
        )
        return f"a policy of {self.inputs} observations, {motors} motors and {of}"

    def summary(self, _genome: FloatArray) -> str:
        """Returns the description, with a part of the digest of a network."""
        part = f", {self.graph.digest[:8]}" if isinstance(self.graph, Graph) else ""
        return f"{self.description}{part}"

    @property
    def function(self) -> str:
        """Name of the function that is in the place of a network."""
        return self.graph.name if isinstance(self.graph, Function) else ""

    def batch(self, genomes: FloatArray, _silent: Sequence[AbstractSet[int]]) -> "PolicyBatch":
        """Returns the batch of as many copies as there are genomes; see ``Design.batch``."""
        return PolicyBatch(self, len(genomes))


class PolicyBatch:
    """The policies of many robots; a ``ControllerBatch``.

    Tensors of the network, by name, may differ from robot to robot, ``(count, ...)``; the others
    are those of the policy.

    Attributes:
        velocity: Commanded velocity of each robot, ``(n, 3)``.
        input: Last input of the network, ``(n, inputs)``.
    """

    def __init__(
        self, policy: Policy, count: int, tensors: Mapping[str, FloatArray] | None = None
    ) -> None:
        own = policy.interface
        action = own.action
        self._graph, self._interface = policy.graph, own
        self.readings = np.zeros((count, len(policy.sensors)))
        signals = {"joint_positions": own.hinges, "joint_velocities": own.hinges}
        widths = {signal: len(signals.get(signal, "xyz")) for signal in policy.observes}
        self._task = f"{TASK_PREFIX}{own.task}"
        other = {"base_orientation": 4, self._task: own.task_width}
        widths |= {signal: width for signal, width in other.items() if signal in widths}
        self.observed: Mapping[str, FloatArray] = {
            signal: np.zeros((count, width)) for signal, width in widths.items()
        }
        self.velocity = np.tile(own.velocity, (count, 1))
        self._joints = [own.hinges.index(name) for name in own.joints]
        self._motors = [policy.motors.index(name) for name in action.motors]
        self._low, self._high = (
            np.array([centre + side * half for centre, half in policy.ranges]) for side in (-1, 1)
        )
        self._numbers = [(np.array(term.offset), np.array(term.scale)) for term in own.terms]
        self._pose = np.array(own.pose)
        self._scale, self._offset = np.array(action.scale), np.array(action.offset)
        self.input = np.zeros((count, policy.inputs))
        self._output = np.zeros((count, policy.graph.outputs))
        self._states = policy.graph.initial(count)
        self._tensors = tensors or {}
        self._running = np.arange(count)
        self._history: list[list[FloatArray]] = []
        self._step = 0

    def step(self, targets: FloatArray) -> None:
        """Writes the commands of the next control step; see ``ControllerBatch``."""
        own = self._interface
        if self._step % own.decimation == 0:
            self.input = self.observation()
            rows = self.input[self._running]
            output, self._states = self._graph.step(rows, self._states, self._tensors)
            most = math.inf if own.action.clip is None else own.action.clip
            self._output[self._running] = np.clip(output, -most, most)
        targets[:] = own.holding
        targets[:, self._motors] = self._offset + self._scale * self._output
        np.clip(targets, self._low, self._high, out=targets)
        self._step += 1

    def end(self, running: IndexArray) -> None:
        """Evaluates the network for some robots only, from now on; see ``ControllerBatch``."""
        if len(running) == len(self._running):
            return
        kept = np.searchsorted(self._running, running)
        self._states = tuple(state[:, kept] for state in self._states)
        self._tensors = {name: rows[kept] for name, rows in self._tensors.items()}
        self._running = running

    def observation(self) -> FloatArray:
        """Returns the input of the network, ``(n, inputs)``, of what is observed now."""
        own, last = self._interface, self._history
        newest = [
            (self._value(term.name) - offset) * scale
            for term, (offset, scale) in zip(own.terms, self._numbers, strict=True)
        ]
        self._history = [*(last or [newest] * own.history)[1:], newest]
        stack = self._history[::-1] if own.newest_first else self._history
        parts = zip(*stack, strict=True) if own.by_term else stack
        return np.concatenate([value for part in parts for value in part], axis=1)

    def _value(self, term: str) -> FloatArray:
        if term in MEASURED:
            signals, of = MEASURED[term]
            value = of(*(self.observed[signal] for signal in signals))
            chosen = value[:, self._joints] if term in JOINT_TERMS else value
            return chosen - self._pose if term == "joint_positions" else chosen
        if term == "phase":
            turn = 2 * math.pi * self._step * self._interface.timestep / self._interface.period
            return np.tile((math.sin(turn), math.cos(turn)), (len(self.readings), 1))
        if term == TASK:
            return self.observed[self._task]
        own = {"last_action": self._output, "velocity": self.velocity, "sensors": self.readings}
        return own[term]
