"""The contract of a kind of fault or of environment, as a check that anybody can run on theirs."""

import mujoco
import numpy as np

from selfmodel.controllers.controller import Controller
from selfmodel.controllers.network import MAX_HIDDEN_NEURONS
from selfmodel.diagnosis.genome import decode, encode
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis, canonical
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import known
from selfmodel.robot.designs import network_for
from selfmodel.robot.embodiment import Embodiment
from selfmodel.robot.robot import Robot
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.behaviour import SIGNALS

STEPS = 20
"""Control steps that are simulated to see that robots with the fault share a batch with others."""


def check_kind(kind: FaultKind, robot: Robot) -> None:
    """Checks that a kind does what ``FaultKind`` says.

    Args:
        kind: The one to check; one that no diagnosis may propose is checked alike.
        robot: One that it can strike.

    Raises:
        ValueError: It breaks its contract; the message says in which way.
        InputError: Its own notation cannot be read back.
    """
    for what, text in (("name", kind.name), ("word", kind.keyword)):
        if not text or set(text) & set(" ,:+="):
            raise ValueError(f"a kind needs a {what} without spaces and any of ,:+=, got {text!r}")
    candidates = kind.candidates(robot.anatomy)
    if not candidates:
        raise ValueError(f"{kind.name} has no part or no level: nothing can be proposed")
    for fault in candidates:
        _check_degree(fault, robot)
        _check_words(fault, robot)
        if kind.absorbs(fault, fault, robot.anatomy):
            raise ValueError(f"{fault} absorbs itself, so it can never be said")
    for other in kind.others:
        if other.severity_bounds is not None or (kind.searchable and not other.searchable):
            raise ValueError(
                f"{kind.name} is {other.name} at some degree, which must be a kind without degrees "
                f"that a diagnosis may propose"
            )
    _check_edits(kind, candidates, robot)
    _check_batch(kind, robot)
    if kind.feel is not None:
        _check_feel(kind, candidates, robot)


def _check_degree(fault: Fault, robot: Robot) -> None:
    if fault.kind.severity_bounds is None:
        if fault.severity != 0:
            raise ValueError(f"{fault} has the level {fault.severity}, and the kind no degrees")
        return
    lowest, highest = fault.kind.severity_bounds(robot.anatomy, fault.part)
    if not lowest <= fault.severity <= highest:
        raise ValueError(f"the level of {fault} is not between {lowest} and {highest}")


def _check_words(fault: Fault, robot: Robot) -> None:
    anatomy, kinds = robot.anatomy, (fault.kind,)
    alone = canonical([fault], anatomy)
    if alone != Hypothesis((fault,)):
        raise ValueError(f"{fault} is a candidate, and alone it means {alone}")
    read = parse(str(alone), anatomy, known(kinds))
    if read != alone:
        raise ValueError(f"{alone} is read back as {read}")
    coded = decode(encode(alone, 1, anatomy, kinds), anatomy, kinds)
    if coded != alone:
        raise ValueError(f"{alone} comes back from the genome as {coded}")


def _check_edits(kind: FaultKind, candidates: tuple[Fault, ...], robot: Robot) -> None:
    before, intact = _saved(robot.model), _contents(build(robot, INTACT))
    changed = False
    for fault in candidates:
        built = _contents(build(robot, Hypothesis((fault,))))
        if built != _contents(build(robot, Hypothesis((fault,)))):
            raise ValueError(f"{fault} does not make the same robot every time")
        changed |= built != intact
    if _saved(robot.model) != before:
        raise ValueError(f"{kind.name} changes the robot itself, not the embodiment it is given")
    if not changed:
        raise ValueError(f"{kind.name} changes nothing about a robot")


def _check_batch(kind: FaultKind, robot: Robot) -> None:
    """One candidate a part, beside an intact robot, and alone."""
    firsts = {fault.part: fault for fault in reversed(kind.candidates(robot.anatomy))}
    hypotheses = [INTACT, *(Hypothesis((fault,)) for fault in firsts.values())]
    network = network_for(robot, MAX_HIDDEN_NEURONS)  # it has the neuron of every fault
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


def _check_feel(kind: FaultKind, candidates: tuple[Fault, ...], robot: Robot) -> None:
    """On ground that was felt, and on ground that was not."""
    on_a_step = np.array([[x, 0.0, 0.02 * (x > 2)] for x in np.linspace(1.5, 3, 200)])
    for fault in candidates:
        for points in (on_a_step, np.empty((0, 3))):
            before, own = points.copy(), build(robot, Hypothesis((fault,)))
            size = mujoco.mj_sizeModel(own.model)
            if kind.feel is not None:
                kind.feel(own, fault, points)
            if mujoco.mj_sizeModel(own.model) != size or not np.array_equal(points, before):
                raise ValueError(f"{kind.name} changes the points it is given, or a model's layout")


def _contents(embodiment: Embodiment) -> tuple[bytes, ...]:
    parts = (embodiment.gain, embodiment.offset, embodiment.bias, embodiment.noise)
    return (
        _saved(embodiment.model),
        str(sorted(embodiment.silent_neurons)).encode(),
        *(part.tobytes() for part in parts),
    )


def _saved(model: mujoco.MjModel) -> bytes:
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()
