"""Contract checks of plug-ins of a diagnosis: of a comparator, and of a fault kind."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from selfmodel import arguments
from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.controllers.controller import Controller
from selfmodel.controllers.network import MAX_HIDDEN_NEURONS
from selfmodel.diagnosis.comparator import (
    Comparator,
    Losses,
    PiecewiseTrial,
    PreparedTrial,
    piece_steps_of,
)
from selfmodel.diagnosis.losses import simulate
from selfmodel.errors import InputError, typed
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.joints import BROKEN, JAMMED
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.robot.designs import network_for
from selfmodel.robot.model_variant import ModelVariant
from selfmodel.robot.robot import Robot
from selfmodel.simulation.requests import ClosedLoop, Ensemble, Request, Segments, recordable
from selfmodel.simulation.simulator import Simulator
from selfmodel.testing.contract import ContractError, called, require, require_alone
from selfmodel.trials.estimation import JOINTS
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial, TrialPlan

CHECKED_STEPS = 60
"""Control steps of the trial on which a comparator is checked without one of its own."""

BATCH_STEPS = 20
"""Control steps of the check that robots with the fault share a batch with others."""


@typed
def check_comparator(
    comparator: Comparator | str, trial: Trial | None = None, simulated: Trajectory | None = None
) -> None:
    """Checks that a comparator fulfils ``Comparator``, and its trials ``PreparedTrial``.

    If the prepared trial has losses, they and their parts are checked too.

    Example:
        >>> import selfmodel
        >>> from selfmodel.comparators import FORWARD_DISPLACEMENT
        >>> selfmodel.check_comparator(FORWARD_DISPLACEMENT)
        >>> robot = selfmodel.load_robot("quadruped")
        >>> walk = selfmodel.read_log("before.mcap").trial.plan.controller
        >>> physical = selfmodel.simulated_robot(robot)
        >>> trial = selfmodel.run_trial(physical, walk, "checked.mcap", robot=robot, steps=20)
        >>> damaged = selfmodel.parse_hypothesis("break:front_left_knee", robot)
        >>> runs = [(selfmodel.Hypothesis(), walk), (damaged, walk)]
        >>> simulated = selfmodel.Simulator(robot).run(runs, 20, ["base_position"]).trajectory
        >>> selfmodel.check_comparator(FORWARD_DISPLACEMENT, trial, simulated)

    Args:
        comparator: The comparator to check, its name, or ``package.module:object``.
        trial: A logged trial. Without one, the comparator is checked on a trial of the quadruped of
            ``CHECKED_STEPS`` steps, simulated for this.
        simulated: The simulation that ``comparator.prepare(trial).request`` requires, for at least
            two hypotheses; the first reproduces the trial to the bit, as ``shown`` returns. Other
            signals are ignored: all signals, ``(n, steps, width)``, serve every ``ClosedLoop``
            request. None for those of the robot in the trial's log, or else of its name.

    Raises:
        ContractError: The comparator violates its contract or raises another error, or
            ``simulated`` does not have the requested shapes; the message names the violation.
        InputError: The name is unknown, the object is no comparator, it refuses the trial of the
            quadruped, or there are simulations without a trial.
    """
    comparator = arguments.comparator_of(comparator)
    if simulated is None:
        trial = trial or _walk()
        simulated = _simulated(comparator, trial)
    elif trial is None:
        raise InputError("expected the trial of simulations, got these alone: give both or none")
    name = comparator.name
    require(
        isinstance(name, str) and name and name == name.strip(),
        f"a comparator needs a name, got {name!r}",
    )
    logged = _bits(trial.trajectory.signals)
    prepared, again = _prepared(comparator, trial), _prepared(comparator, trial)
    request = prepared.request
    _check_request(request, trial)
    require(
        _content(request) == _content(again.request),
        "the same trial must be prepared with the same request",
    )
    if sections := getattr(prepared, "sections", ()):
        pieces, *of_sections = [
            [] if (steps := piece_steps_of(one)) is None else steps.tolist()
            for one in (prepared, *sections)
        ]
        require(
            pieces == list(chain(*of_sections)) and all(of_sections),
            "the sections of a trial must have its piece_steps, in their order",
        )
    requested = _as_requested(request, trial, simulated)
    before = _bits(requested.signals)
    parts = _parts(prepared, requested)
    runs = len(requested[request.record[0]])
    for what, values in parts.items():
        _check_numbers(what, values, runs)
    for other in (prepared, again):
        repeated = _parts(other, requested)
        for what, values in parts.items():
            same = what in repeated and np.array_equal(repeated[what], values, equal_nan=True)
            require(same, f"the same trial and arguments must give the same {what}")
    for run in range(runs):
        for what, values in _parts(prepared, _only(requested, run)).items():
            require_alone(f"{what} of run {run}", values, parts[what][run : run + 1])
    require(before == _bits(requested.signals), "a comparator must not change its arguments")
    require(logged == _bits(trial.trajectory.signals), "a comparator must not change the trial")


def _walk() -> Trial:
    robot = arguments.load_robot("quadruped")
    network = network_for(robot)
    controller = Controller(network, np.linspace(-1, 1, network.weights))
    run = [(INTACT, controller)]
    logged = Simulator(robot, 1).run(run, CHECKED_STEPS, SIGNALS).trajectory.run(0)
    plan = TrialPlan("check", "single", controller, CHECKED_STEPS, 0)
    return Trial(plan, robot.name, logged, "check")


def _simulated(comparator: Comparator, trial: Trial) -> Trajectory:
    """Returns what a comparator requires of a trial: exact, then of a damaged robot."""
    log = Path(trial.path)
    logs = arguments.read_logs([log] if log.is_file() else [])
    robot = arguments.robot_of_logs(logs, None) if logs else arguments.load_robot(trial.robot)
    arguments.check_trials(robot, trial)
    request = _prepared(comparator, trial).request
    _check_request(request, trial)
    faults = BROKEN.candidates(robot.anatomy) or JAMMED.candidates(robot.anatomy)
    damaged = Hypothesis(faults[:1])
    runs = simulate(Simulator(robot, 1), request, trial, [INTACT, damaged]).trajectory
    exact = shown(request, trial)
    signals = {one: np.concatenate([exact[one], runs[one][1:]]) for one in request.record}
    return replace(runs, signals=signals)


def _prepared(comparator: Comparator, trial: Trial) -> PreparedTrial | PiecewiseTrial:
    prepared: PreparedTrial | PiecewiseTrial = called("prepare", comparator.prepare, trial)
    require(
        isinstance(prepared, PreparedTrial | PiecewiseTrial),
        f"prepare must return an object with request and losses or distances, got {prepared!r}",
    )
    return prepared


def _bits(arrays: Mapping[Any, NDArray[Any]]) -> dict[Any, bytes]:
    return {name: values.tobytes() for name, values in arrays.items()}


def _content(request: Request) -> object:
    if not isinstance(request, Segments):
        return request
    arrays = _bits({**request.states, "starts": request.starts, "commands": request.commands})
    return request.horizon, request.record, arrays


def _parts(
    prepared: PreparedTrial | PiecewiseTrial, simulated: Trajectory
) -> dict[str, FloatArray]:
    """Returns everything that a comparison returns, by its name."""
    if not isinstance(prepared, PiecewiseTrial):
        return {"distances": np.asarray(called("distances", prepared.distances, simulated))}
    found = called("losses", prepared.losses, simulated)
    losses = found if isinstance(found, Losses) else Losses(np.asarray(found))
    parts = {f"losses of {name}": part for name, part in losses.by_signal.items()}
    by_hinge = {} if losses.by_hinge is None else {"losses of hinges": losses.by_hinge}
    return {"losses": losses.total, **parts, **by_hinge}


def _only(simulated: Trajectory, run: int) -> Trajectory:
    row = slice(run, run + 1)
    return replace(
        simulated,
        signals={signal: values[row] for signal, values in simulated.signals.items()},
        welded=None if simulated.welded is None else simulated.welded[row],
        detached=None if simulated.detached is None else simulated.detached[row],
    )


def _check_numbers(what: str, values: FloatArray, runs: int) -> None:
    sizes = ("n", "1 or more pieces", "hinges")
    shape = sizes[: {"distances": 1, "losses of hinges": 3}.get(what, 2)]
    require(
        values.ndim == len(shape) and len(values) == runs and 0 not in values.shape[1:2],
        f"{what} must have shape ({', '.join(shape)}) with n = {runs}, got {values.shape}",
    )
    of_known = ~np.isnan(values) if what == "losses of hinges" else np.full(values.shape, True)
    require(
        (np.isfinite(values[of_known]) & (values[of_known] >= 0)).all(),
        f"{what} must be finite and at least 0, got {values}",
    )
    require(
        (values[0][of_known[0]] == 0).all(),
        f"{what} of a run that reproduces the trial must be 0, got {values[0]}",
    )


@typed
def shown(request: Request, trial: Trial) -> Trajectory:
    """Returns a simulation that reproduces a trial to the bit.

    A real simulation of segments differs by about 1e-9 even for the true hypothesis, because the
    contact solver starts from other initial guesses than in one long run.

    Args:
        request: The request of the prepared trial.
        trial: A logged trial; for segments, a trial without noise, whose estimated states are the
            logged states.

    Returns:
        The requested signals, with a leading axis of one run.
    """
    trajectory, time = trial.trajectory, trial.trajectory.time
    rows: IndexArray = np.arange(trajectory.steps)
    if isinstance(request, Segments):
        rows = request.starts[:, np.newaxis] + np.arange(request.horizon + 1)
        time = time[: request.horizon + 1]
    elif isinstance(request, Ensemble):
        rows = np.tile(rows, (request.members, 1))
    signals = {signal: trajectory[signal][rows][np.newaxis] for signal in request.record}
    return Trajectory(trajectory.names, time, signals)


def _check_request(request: Request, trial: Trial) -> None:
    require(
        isinstance(request, ClosedLoop | Segments | Ensemble),
        f"a request must be a ClosedLoop, Segments or an Ensemble, got {request!r}",
    )
    possible = recordable(request)
    require(
        request.record and set(request.record) <= set(possible),
        f"a request of {type(request).__name__} must record some of {possible}, got "
        f"{request.record}",
    )
    if isinstance(request, Ensemble):
        require(
            request.members >= 1 and request.level >= 0,
            f"an ensemble needs at least one member and a level of at least 0, got "
            f"{request.members} members at level {request.level}",
        )
    if isinstance(request, Segments):
        _check_segments(request, trial.trajectory)


def _check_segments(request: Segments, logged: Trajectory) -> None:
    starts, horizon, commands = request.starts, request.horizon, request.commands
    require(
        commands.shape == logged["commands"].shape,
        f"the commands of segments must be those of the trial, of shape (steps, motors) = "
        f"{logged['commands'].shape}, got {commands.shape}",
    )
    last = logged.steps - 1 - horizon
    require(
        horizon >= 1 and starts.size and ((starts >= 0) & (starts <= last)).all(),
        f"segments need a horizon of at least 1 step, got {horizon}, and at least one start, "
        f"from 0 to {last}, got {starts.tolist()}",
    )
    require(
        np.isfinite(commands[starts[:, np.newaxis] + np.arange(horizon)]).all(),
        "the commands of segments must be finite",
    )
    for signal, values in request.states.items():
        expected = (len(starts), logged.names.width(signal))
        require(
            values.shape == expected,
            f"the states of {signal} must have shape (segments, width) = {expected}, got "
            f"{values.shape}",
        )
        wrong = np.isinf(values) if signal in JOINTS else ~np.isfinite(values)
        require(
            not wrong.any(),
            f"the states of {signal} must be finite; only those of joints may be NaN, where a "
            f"hinge is unknown",
        )


def _as_requested(request: Request, trial: Trial, simulated: Trajectory) -> Trajectory:
    """Returns the requested signals of a simulation, after a check of their shapes."""
    lengths: tuple[int, ...] = (trial.trajectory.steps,)
    if isinstance(request, Segments):
        lengths = (len(request.starts), request.horizon + 1)
    elif isinstance(request, Ensemble):
        lengths = (request.members, *lengths)
    signals = {signal: simulated[signal] for signal in request.record}
    for signal, values in signals.items():
        require(
            values.shape[1:-1] == lengths,
            f"for a request of {type(request).__name__}, {signal} must have shape "
            f"(n, {', '.join(map(str, lengths))}, width), got {values.shape}",
        )
    return replace(simulated, signals=signals)


def check_fault_kind(kind: FaultKind | str, robot: arguments.RobotSource = "quadruped") -> None:
    """Checks that a kind fulfils the contract of ``FaultKind``.

    Example:
        >>> import selfmodel
        >>> kind = selfmodel.PAPER_KINDS[0]
        >>> selfmodel.check_fault_kind(kind, "quadruped")

    Args:
        kind: The kind to check, searchable or not, its name, or ``package.module:object``.
        robot: A robot that the kind applies to, its name, or the path of its MJCF or URDF file.

    Raises:
        ContractError: The kind breaks its contract; the message names the broken rule.
        InputError: The notation of the kind's own faults cannot be parsed, or an argument is no
            kind or robot.
    """
    robot, kinds = arguments.load_robot(robot), arguments.kinds_of(kind)
    if len(kinds) != 1:
        raise InputError(f"expected one kind, got {len(kinds)}: check each of them")
    (kind,) = kinds
    for what, text in (("name", kind.name), ("keyword", kind.keyword)):
        require(
            text and not set(text) & set(" ,:+="),
            f"a kind needs a {what} without spaces and without any of ,:+=, got {text!r}",
        )
    parts = kind.parts(robot.anatomy)
    require(isinstance(parts, tuple), f"the parts of {kind.name} must be a tuple, got {parts!r}")
    candidates = kind.candidates(robot.anatomy)
    require(candidates, f"{kind.name} has no part or no level: nothing can be proposed")
    for fault in candidates:
        _check_candidate(fault, robot)
    _check_words(kind, candidates)
    for other in kind.degenerate_kinds:
        require(
            0.0 in (other.bounds or (0.0,)) and (other.searchable or not kind.searchable),
            f"{kind.name} degenerates to {other.name}, which must be a searchable kind without "
            f"severities, or with 0 as the least or largest",
        )
    _check_edits(kind, candidates, robot)
    _check_batch(candidates, robot)
    if kind.adapts_to_contacts:
        _check_contacts(kind, candidates, robot)
    joints = {joint.name for joint in robot.anatomy.joints}
    others = sorted({fault.part for fault in candidates} - joints)
    require(
        not (kind.is_of_joint and others),
        f"{kind.name} is of joints, and {', '.join(others)} is no joint",
    )
    if type(kind).contradicted is not FaultKind.contradicted:
        _check_contradictions(kind, candidates, robot)


def _check_candidate(fault: Fault, robot: Robot) -> None:
    bounds = fault.kind.bounds_at(robot.anatomy, fault.part)
    require(
        bounds or fault.severity == 0,
        f"{fault} has the level {fault.severity}, but its kind has no bounds",
    )
    lowest, highest = bounds or (0, 0)
    require(
        lowest <= fault.severity <= highest,
        f"the level of {fault} is not between {lowest} and {highest}",
    )
    space = HypothesisSpace(robot.anatomy, (fault.kind,))
    alone = space.canonical([fault])
    require(
        alone == Hypothesis((fault,)),
        f"{fault} is a candidate, but its canonical form is {alone}",
    )
    parsed, decoded = space.parse(str(alone)), space.decode(space.encode(alone, 1))
    require(parsed == alone, f"{alone} is parsed as {parsed}")
    require(decoded == alone, f"{alone} is decoded from its genome as {decoded}")
    require(
        not fault.kind.absorbs(fault, fault, robot.anatomy),
        f"{fault} absorbs itself, so no hypothesis can contain it",
    )


def _check_words(kind: FaultKind, candidates: tuple[Fault, ...]) -> None:
    """Checks that the words of a kind are a format, and tell its parts apart."""
    try:
        words = {fault.part: fault.words for fault in candidates}
    except (LookupError, ValueError) as error:
        raise ContractError(
            f"expected words of {kind.name} with part, severity, amount, degrees, side and at, got "
            f"{kind.words!r}: {error!r}"
        ) from error
    require(
        len(set(words.values())) == len(words),
        f"the words of {kind.name} are the same at two parts: {kind.words!r}",
    )


def _check_edits(kind: FaultKind, candidates: tuple[Fault, ...], robot: Robot) -> None:
    before, nominal = _saved(robot.model), _contents(build(robot, INTACT))
    changed = False
    for fault in candidates:
        built, again = (_contents(build(robot, Hypothesis((fault,)))) for _ in range(2))
        require(built == again, f"{fault} does not make the same robot every time")
        changed |= built != nominal
    require(
        _saved(robot.model) == before,
        f"{kind.name} changes the robot itself instead of its variant",
    )
    require(changed, f"{kind.name} changes nothing about a robot")


def _check_batch(candidates: tuple[Fault, ...], robot: Robot) -> None:
    """Checks that a robot with a fault moves equally alone and in a batch, for each part."""
    firsts = {fault.part: fault for fault in reversed(candidates)}
    network = network_for(robot, MAX_HIDDEN_NEURONS)  # with the neurons of all faults
    controller = Controller(network, np.linspace(-1, 1, network.weights))
    runs = [(INTACT, controller)]
    runs += [(Hypothesis((fault,)), controller) for fault in firsts.values()]
    simulator = Simulator(robot, 1)
    together = simulator.run(runs, BATCH_STEPS, SIGNALS).trajectory
    for row, run in enumerate(runs):
        alone = simulator.run([run], BATCH_STEPS, SIGNALS).trajectory
        require(
            all(np.array_equal(alone[signal][0], together[signal][row]) for signal in SIGNALS),
            f"a robot with {run[0]} moves differently in a batch and alone",
        )


def _check_contacts(kind: FaultKind, candidates: tuple[Fault, ...], robot: Robot) -> None:
    """Checks ``adapt_to_contacts`` with contact points on a terrain step, and with none."""
    on_a_step = np.array([[x, 0.0, 0.02 * (x > 2)] for x in np.linspace(1.5, 3, 200)])
    for fault in candidates:
        for points in (on_a_step, np.empty((0, 3))):
            before, own = points.copy(), build(robot, Hypothesis((fault,)))
            size = mujoco.mj_sizeModel(own.model)
            kind.adapt_to_contacts(own, fault, points)
            require(
                mujoco.mj_sizeModel(own.model) == size and np.array_equal(points, before),
                f"{kind.name} changes the contact points, or a model's layout",
            )


def _check_contradictions(kind: FaultKind, candidates: tuple[Fault, ...], robot: Robot) -> None:
    """Checks that the log of a robot with a fault does not contradict the fault."""
    network = network_for(robot)
    controller = Controller(network, np.linspace(-1, 1, network.weights))
    runs = [(Hypothesis((fault,)), controller) for fault in candidates]
    simulated = Simulator(robot, 1).run(runs, BATCH_STEPS, SIGNALS).trajectory
    for row, fault in enumerate(candidates):
        mask = kind.contradicted(fault, simulated.run(row))
        require(
            np.shape(mask) == (BATCH_STEPS,) and np.asarray(mask).dtype == np.bool_,
            f"{kind.name} must return a mask of the {BATCH_STEPS} steps of a log",
        )
        require(not np.any(mask), f"the log of a robot with {fault} contradicts the fault")


def _contents(variant: ModelVariant) -> tuple[bytes, ...]:
    own = variant
    parts = (own.gain, own.offset, own.bias, own.noise, own.added_delay, own.encoder_offset)
    silent = str(sorted(own.silent_neurons)).encode()
    return (_saved(own.model), silent, *(part.tobytes() for part in parts))


def _saved(model: mujoco.MjModel) -> bytes:
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()
