"""Contract checks for a kind of fault or of environment, for built-in and third-party kinds."""

import mujoco
import numpy as np

from selfmodel.controllers.controller import Controller
from selfmodel.controllers.network import MAX_HIDDEN_NEURONS
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.robot.designs import network_for
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.signals import SIGNALS

STEPS = 20
"""Control steps of the check that robots with the fault share a batch with others."""


def check_fault_kind(kind: FaultKind, robot: Robot) -> None:
    """Checks that a kind fulfils the contract of ``FaultKind``.

    Example:
        >>> import selfmodel
        >>> kind = selfmodel.PAPER_KINDS[0]
        >>> selfmodel.check_fault_kind(kind, selfmodel.load_robot("quadruped"))

    Args:
        kind: The kind to check, searchable or not.
        robot: A robot that the kind applies to.

    Raises:
        ValueError: The kind breaks its contract; the message names the broken rule.
        InputError: The notation of the kind's own faults cannot be parsed.
    """
    for what, text in (("name", kind.name), ("keyword", kind.keyword)):
        if not text or set(text) & set(" ,:+="):
            raise ValueError(
                f"a kind needs a {what} without spaces and without any of ,:+=, got {text!r}"
            )
    candidates = kind.candidates(robot.anatomy)
    if not candidates:
        raise ValueError(f"{kind.name} has no part or no level: nothing can be proposed")
    for fault in candidates:
        _check_severity(fault, robot)
        _check_round_trips(fault, robot)
        if kind.absorbs(fault, fault, robot.anatomy):
            raise ValueError(f"{fault} absorbs itself, so no hypothesis can contain it")
    for other in kind.degenerate_kinds:
        if other.bounds is not None or (kind.searchable and not other.searchable):
            raise ValueError(
                f"{kind.name} degenerates to {other.name}, which must be a searchable kind "
                f"without severities"
            )
    _check_edits(kind, candidates, robot)
    _check_batch(kind, robot)
    if kind.adapts_to_contacts:
        _check_contacts(kind, candidates, robot)
    _check_parts(kind, candidates, robot)
    _check_contradictions(kind, candidates, robot)


def _check_severity(fault: Fault, robot: Robot) -> None:
    bounds = fault.kind.bounds_at(robot.anatomy, fault.part)
    if bounds is None:
        if fault.severity != 0:
            raise ValueError(f"{fault} has the level {fault.severity}, but its kind has no bounds")
        return
    lowest, highest = bounds
    if not lowest <= fault.severity <= highest:
        raise ValueError(f"the level of {fault} is not between {lowest} and {highest}")


def _check_round_trips(fault: Fault, robot: Robot) -> None:
    space = HypothesisSpace(robot.anatomy, (fault.kind,))
    alone = space.canonical([fault])
    if alone != Hypothesis((fault,)):
        raise ValueError(f"{fault} is a candidate, but its canonical form is {alone}")
    parsed = space.parse(str(alone))
    if parsed != alone:
        raise ValueError(f"{alone} is parsed as {parsed}")
    decoded = space.decode(space.encode(alone, 1))
    if decoded != alone:
        raise ValueError(f"{alone} is decoded from its genome as {decoded}")


def _check_edits(kind: FaultKind, candidates: tuple[Fault, ...], robot: Robot) -> None:
    before, nominal = _saved(robot.model), _contents(build(robot, INTACT))
    changed = False
    for fault in candidates:
        built = _contents(build(robot, Hypothesis((fault,))))
        if built != _contents(build(robot, Hypothesis((fault,)))):
            raise ValueError(f"{fault} does not make the same robot every time")
        changed |= built != nominal
    if _saved(robot.model) != before:
        raise ValueError(f"{kind.name} changes the robot itself instead of its embodiment")
    if not changed:
        raise ValueError(f"{kind.name} changes nothing about a robot")


def _check_batch(kind: FaultKind, robot: Robot) -> None:
    """Checks that a robot with a fault moves equally alone and in a batch, for each part."""
    firsts = {fault.part: fault for fault in reversed(kind.candidates(robot.anatomy))}
    hypotheses = [INTACT, *(Hypothesis((fault,)) for fault in firsts.values())]
    network = network_for(robot, MAX_HIDDEN_NEURONS)  # with the neurons of all faults
    controller = Controller(network, np.linspace(-1, 1, network.weights))
    runs = [(hypothesis, controller) for hypothesis in hypotheses]
    simulator = Simulator(robot, 1)
    together = simulator.run(runs, STEPS, SIGNALS)
    for row, run in enumerate(runs):
        alone = simulator.run([run], STEPS, SIGNALS)
        if any(
            not np.array_equal(alone.behaviour[signal][0], together.behaviour[signal][row])
            for signal in SIGNALS
        ):
            raise ValueError(f"a robot with {run[0]} moves differently in a batch and alone")


def _check_contacts(kind: FaultKind, candidates: tuple[Fault, ...], robot: Robot) -> None:
    """Checks ``adapt_to_contacts`` with contact points on a terrain step, and with none."""
    on_a_step = np.array([[x, 0.0, 0.02 * (x > 2)] for x in np.linspace(1.5, 3, 200)])
    for fault in candidates:
        for points in (on_a_step, np.empty((0, 3))):
            before, own = points.copy(), build(robot, Hypothesis((fault,)))
            size = mujoco.mj_sizeModel(own.model)
            kind.adapt_to_contacts(own, fault, points)
            if mujoco.mj_sizeModel(own.model) != size or not np.array_equal(points, before):
                raise ValueError(f"{kind.name} changes the contact points, or a model's layout")


def _check_parts(kind: FaultKind, candidates: tuple[Fault, ...], robot: Robot) -> None:
    joints = {joint.name for joint in robot.anatomy.joints}
    others = sorted({fault.part for fault in candidates} - joints)
    if kind.is_of_joint and others:
        raise ValueError(f"{kind.name} is of joints, and {', '.join(others)} is no joint")


def _check_contradictions(kind: FaultKind, candidates: tuple[Fault, ...], robot: Robot) -> None:
    """Checks that the log of a robot with a fault does not contradict the fault."""
    if type(kind).contradicted is FaultKind.contradicted:
        return
    network = network_for(robot)
    controller = Controller(network, np.linspace(-1, 1, network.weights))
    hypotheses = [Hypothesis((fault,)) for fault in candidates]
    runs = [(hypothesis, controller) for hypothesis in hypotheses]
    simulated = Simulator(robot, 1).run(runs, STEPS, SIGNALS).behaviour
    for row, fault in enumerate(candidates):
        signals = {signal: values[row] for signal, values in simulated.signals.items()}
        log = Behaviour(simulated.names, simulated.time, signals)
        mask = kind.contradicted(fault, log)
        if np.shape(mask) != (STEPS,) or np.asarray(mask).dtype != np.bool_:
            raise ValueError(f"{kind.name} must return a mask of the {STEPS} steps of a log")
        if np.any(mask):
            raise ValueError(f"the log of a robot with {fault} contradicts the fault")


def _contents(embodiment: Embodiment) -> tuple[bytes, ...]:
    own = embodiment
    parts = (own.gain, own.offset, own.bias, own.noise, own.added_delay, own.encoder_offset)
    return (
        _saved(embodiment.model),
        str(sorted(embodiment.silent_neurons)).encode(),
        *(part.tobytes() for part in parts),
    )


def _saved(model: mujoco.MjModel) -> bytes:
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()
