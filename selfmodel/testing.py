"""Contract checks of plug-ins: of a comparator, and of a fault kind."""

from dataclasses import replace

import mujoco
import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.controllers.controller import Controller
from selfmodel.controllers.network import MAX_HIDDEN_NEURONS
from selfmodel.diagnosis.comparator import Comparator, Losses, PiecewiseTrial, PreparedTrial
from selfmodel.faults.build import build
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.robot.designs import network_for
from selfmodel.robot.model_variant import ModelVariant
from selfmodel.robot.robot import Robot
from selfmodel.simulation.requests import ClosedLoop, Ensemble, Request, Segments, recordable
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.estimation import JOINTS
from selfmodel.trials.signals import SIGNALS
from selfmodel.trials.trajectory import Trajectory
from selfmodel.trials.trial import Trial

DEPENDS_ON_BATCH = (
    "must not depend on the other runs, to the last bit: numpy sums in memory order, so "
    "np.ascontiguousarray is required before a sum or a mean"
)


def check_comparator(comparator: Comparator, trial: Trial, simulated: Trajectory) -> None:
    """Checks that a comparator fulfils ``Comparator``, and its trials ``PreparedTrial``.

    If the prepared trial has losses, they and their parts are checked too.

    Example:
        >>> import selfmodel
        >>> from selfmodel.comparators import FORWARD_DISPLACEMENT
        >>> robot = selfmodel.load_robot("quadruped")
        >>> walk = selfmodel.read_log("before.mcap").trial.plan.controller
        >>> physical = selfmodel.simulated_robot(robot)
        >>> trial = selfmodel.run_trial(physical, walk, "checked.mcap", robot=robot, steps=20)
        >>> damaged = selfmodel.parse_hypothesis("break:front_left_knee", robot)
        >>> runs = [(selfmodel.Hypothesis(), walk), (damaged, walk)]
        >>> simulated = selfmodel.Simulator(robot).run(runs, 20, ["base_position"]).trajectory
        >>> selfmodel.check_comparator(FORWARD_DISPLACEMENT, trial, simulated)

    Args:
        comparator: The comparator to check.
        trial: A logged trial.
        simulated: The simulation that ``comparator.prepare(trial).request`` requires, for at least
            two hypotheses; the first reproduces the trial to the bit, as ``shown`` returns. Other
            signals are ignored: all signals, ``(n, steps, width)``, serve every ``ClosedLoop``
            request.

    Raises:
        ValueError: The comparator violates its contract, or ``simulated`` does not have the
            requested shapes; the message names the violation.
    """
    if not comparator.name or comparator.name != comparator.name.strip():
        raise ValueError(f"a comparator needs a name, got {comparator.name!r}")
    logged = _copied(trial.trajectory)
    prepared, again = comparator.prepare(trial), comparator.prepare(trial)
    for one in (prepared, again):
        if not isinstance(one, PreparedTrial | PiecewiseTrial):
            raise ValueError(  # noqa: TRY004  # every breach of the contract is a ValueError
                f"prepare must return an object with request and losses or distances, got {one!r}"
            )
    _check_request(prepared.request, trial)
    if not _is_same_request(prepared.request, again.request):
        raise ValueError("the same trial must be prepared with the same request")
    requested = _as_requested(prepared.request, trial, simulated)
    before = _copied(requested)
    if isinstance(prepared, PiecewiseTrial) != isinstance(again, PiecewiseTrial):
        raise ValueError("a trial that is prepared again must have losses again")
    _check_comparison(prepared, again, requested)
    if not _is_same(before, requested):
        raise ValueError("a comparator must not change its arguments")
    if not _is_same(logged, trial.trajectory):
        raise ValueError("a comparator must not change the trial")


def _check_comparison(
    prepared: PreparedTrial | PiecewiseTrial,
    again: PreparedTrial | PiecewiseTrial,
    simulated: Trajectory,
) -> None:
    """Checks the numbers of a comparison, and that they depend on the trial and each run alone."""
    runs = len(simulated[prepared.request.record[0]])
    parts = _parts(prepared, simulated)
    for what, values in parts.items():
        _check_numbers(what, values, runs)
    for other in (prepared, again):
        for what, values in _parts(other, simulated).items():
            if not np.array_equal(values, parts[what], equal_nan=True):
                raise ValueError(f"the same trial and arguments must give the same {what}")
    for run in range(runs):
        for what, values in _parts(prepared, _only(simulated, run)).items():
            if not np.array_equal(values, parts[what][run : run + 1], equal_nan=True):
                raise ValueError(f"the {what} of run {run} {DEPENDS_ON_BATCH}")


def _parts(
    prepared: PreparedTrial | PiecewiseTrial, simulated: Trajectory
) -> dict[str, FloatArray]:
    """Returns everything that a comparison returns, by its name."""
    if not isinstance(prepared, PiecewiseTrial):
        return {"distances": np.asarray(prepared.distances(simulated))}
    found = prepared.losses(simulated)
    losses = found if isinstance(found, Losses) else Losses(np.asarray(found))
    parts = {f"losses of {name}": part for name, part in losses.by_signal.items()}
    by_hinge = {} if losses.by_hinge is None else {"losses of hinges": losses.by_hinge}
    return {"losses": losses.total, **parts, **by_hinge}


def _check_numbers(what: str, values: FloatArray, runs: int) -> None:
    dimensions = {"distances": 1, "losses of hinges": 3}.get(what, 2)
    if values.ndim != dimensions or len(values) != runs or 0 in values.shape[1:2]:
        shape = ("n", "1 or more pieces", "hinges")[:dimensions]
        raise ValueError(
            f"{what} must have shape ({', '.join(shape)}) with n = {runs}, got {values.shape}"
        )
    unknown = np.isnan(values) if what == "losses of hinges" else np.zeros_like(values, dtype=bool)
    if not ((np.isfinite(values) & (values >= 0)) | unknown).all():
        raise ValueError(f"{what} must be finite and at least 0, got {values}")
    if (values[0][~unknown[0]] != 0).any():
        raise ValueError(f"{what} of a run that reproduces the trial must be 0, got {values[0]}")


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
    if not isinstance(request, ClosedLoop | Segments | Ensemble):
        raise ValueError(  # noqa: TRY004  # every breach of the contract is a ValueError
            f"a request must be a ClosedLoop, Segments or an Ensemble, got {request!r}"
        )
    possible = recordable(request)
    if not request.record or not set(request.record) <= set(possible):
        raise ValueError(
            f"a request of {type(request).__name__} must record some of {possible}, got "
            f"{request.record}"
        )
    if isinstance(request, Ensemble) and not (request.members >= 1 and request.level >= 0):
        raise ValueError(
            f"an ensemble needs at least one member and a level of at least 0, got "
            f"{request.members} members at level {request.level}"
        )
    if isinstance(request, Segments):
        _check_segments(request, trial)


def _check_segments(request: Segments, trial: Trial) -> None:
    trajectory, starts, horizon = trial.trajectory, request.starts, request.horizon
    names, expected = trajectory.names, trajectory["commands"].shape
    if request.commands.shape != expected:
        raise ValueError(
            f"the commands of segments must be those of the trial, of shape (steps, motors) = "
            f"{expected}, got {request.commands.shape}"
        )
    last = trajectory.steps - 1 - horizon
    if horizon < 1 or not starts.size or not ((starts >= 0) & (starts <= last)).all():
        raise ValueError(
            f"segments need a horizon of at least 1 step, got {horizon}, and at least one start, "
            f"from 0 to {last}, got {starts.tolist()}"
        )
    for signal, values in request.states.items():
        expected = (len(starts), names.width(signal))
        if values.shape != expected:
            raise ValueError(
                f"the states of {signal} must have shape (segments, width) = {expected}, got "
                f"{values.shape}"
            )
    if not np.isfinite(request.commands[starts[:, np.newaxis] + np.arange(horizon)]).all():
        raise ValueError("the commands of segments must be finite")
    for signal, values in request.states.items():
        wrong = np.isinf(values) if signal in JOINTS else ~np.isfinite(values)
        if wrong.any():
            raise ValueError(
                f"the states of {signal} must be finite; only those of joints may be NaN, where a "
                f"hinge is unknown"
            )


def _is_same_request(one: Request, other: Request) -> bool:
    if isinstance(one, Segments) and isinstance(other, Segments):
        return (
            (one.horizon, one.record) == (other.horizon, other.record)
            and np.array_equal(one.starts, other.starts)
            and np.array_equal(one.commands, other.commands, equal_nan=True)
            and one.states.keys() == other.states.keys()
            and all(np.array_equal(one.states[key], other.states[key]) for key in one.states)
        )
    return one == other


def _as_requested(request: Request, trial: Trial, simulated: Trajectory) -> Trajectory:
    """Returns the requested signals of a simulation, after a check of their shapes."""
    lengths: tuple[int, ...] = (trial.trajectory.steps,)
    if isinstance(request, Segments):
        lengths = (len(request.starts), request.horizon + 1)
    elif isinstance(request, Ensemble):
        lengths = (request.members, trial.trajectory.steps)
    for signal in request.record:
        if simulated[signal].shape[1:-1] != lengths:
            raise ValueError(
                f"for a request of {type(request).__name__}, {signal} must have shape "
                f"(n, {', '.join(map(str, lengths))}, width), got {simulated[signal].shape}"
            )
    signals = {signal: simulated[signal] for signal in request.record}
    return replace(simulated, signals=signals)


def _copied(trajectory: Trajectory) -> Trajectory:
    signals = {signal: values.copy() for signal, values in trajectory.signals.items()}
    return replace(trajectory, signals=signals)


def _is_same(one: Trajectory, other: Trajectory) -> bool:
    return all(
        np.array_equal(values, other[signal], equal_nan=True)
        for signal, values in one.signals.items()
    )


def _only(simulated: Trajectory, run: int) -> Trajectory:
    return replace(
        simulated,
        signals={signal: values[run : run + 1] for signal, values in simulated.signals.items()},
        welded=None if simulated.welded is None else simulated.welded[run : run + 1],
        detached=None if simulated.detached is None else simulated.detached[run : run + 1],
    )


BATCH_STEPS = 20
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
        raise ValueError(f"{kind.name} changes the robot itself instead of its variant")
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
    together = simulator.run(runs, BATCH_STEPS, SIGNALS)
    for row, run in enumerate(runs):
        alone = simulator.run([run], BATCH_STEPS, SIGNALS)
        if any(
            not np.array_equal(alone.trajectory[signal][0], together.trajectory[signal][row])
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
    simulated = Simulator(robot, 1).run(runs, BATCH_STEPS, SIGNALS).trajectory
    for row, fault in enumerate(candidates):
        signals = {signal: values[row] for signal, values in simulated.signals.items()}
        log = Trajectory(simulated.names, simulated.time, signals)
        mask = kind.contradicted(fault, log)
        if np.shape(mask) != (BATCH_STEPS,) or np.asarray(mask).dtype != np.bool_:
            raise ValueError(f"{kind.name} must return a mask of the {BATCH_STEPS} steps of a log")
        if np.any(mask):
            raise ValueError(f"the log of a robot with {fault} contradicts the fault")


def _contents(variant: ModelVariant) -> tuple[bytes, ...]:
    own = variant
    parts = (own.gain, own.offset, own.bias, own.noise, own.added_delay, own.encoder_offset)
    return (
        _saved(variant.model),
        str(sorted(variant.silent_neurons)).encode(),
        *(part.tobytes() for part in parts),
    )


def _saved(model: mujoco.MjModel) -> bytes:
    buffer = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, buffer)
    return buffer.tobytes()
