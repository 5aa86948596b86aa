"""The cases: each draws its faults for a robot and a seed."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.foreign.faults import Fault
from benchmarks.foreign.robots import Robot
from benchmarks.foreign.seeds import stream

Draw = Callable[[Robot, np.random.Generator], tuple[Fault, ...]]
PartDraw = Callable[[Robot, np.random.Generator], str]
SeverityDraw = Callable[[np.random.Generator], float]


@dataclass(frozen=True)
class Case:
    """A case.

    Attributes:
        name: Its name.
        group: Its group in the tables.
        draw: Draws the faults.
        onset: Whether the faults begin in mid-trial.
        network: Whether a network has to control the robot, because sensors are wrong.
    """

    name: str
    group: str
    draw: Draw
    onset: bool = False
    network: bool = False


def faults_of(case: Case, robot: Robot, seed: int) -> tuple[Fault, ...]:
    """Returns the faults of a case; they do not depend on the gap."""
    return case.draw(robot, stream(seed, robot.name, case.name, "faults"))


def onset_of(case: Case, robot: Robot, seed: int) -> float | None:
    """Returns the time at which the faults begin, s; None if they hold from the start."""
    if not case.onset:
        return None
    drawn = stream(seed, robot.name, case.name, "onset").uniform(3, 7)
    return round(round(drawn / robot.control_timestep) * robot.control_timestep, 6)


def _single(kind: str, part: PartDraw, severity: SeverityDraw) -> Draw:
    """Returns a draw of one fault: its part, and then its severity."""

    def draw(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
        return (Fault(kind, part(robot, rng), severity(rng)),)

    return draw


def _lost(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    return _limb(robot, rng, ("freezes", "follows"))


def _lost_with_debris(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    (fault,) = _lost(robot, rng)
    return (replace(fault, debris=True),)


def _limb(robot: Robot, rng: np.random.Generator, modes: tuple[str, ...]) -> tuple[Fault, ...]:
    return (Fault("lost", _part(robot, rng), encoders=str(rng.choice(modes))),)


def _part(robot: Robot, rng: np.random.Generator) -> str:
    return robot.parts[rng.integers(len(robot.parts))].name


def _hinge_part(robot: Robot, rng: np.random.Generator) -> str:
    """Draws a part of one hinge."""
    single = [part.name for part in robot.parts if len(part.hinges) == 1]
    return single[rng.integers(len(single))]


def _environment(robot: Robot, rng: np.random.Generator) -> str:
    """Returns the part of a fault of the environment, or of the whole robot."""
    del robot, rng
    return ""


def _signed(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.choice((-1, 1)) * rng.uniform(low, high))


def _between(low: float, high: float, digits: int = 3) -> SeverityDraw:
    return lambda rng: round(rng.uniform(low, high), digits)


def _either_sign(low: float, high: float, digits: int = 3) -> SeverityDraw:
    return lambda rng: round(_signed(rng, low, high), digits)


def _jam(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    """A jam at 0, or at the end of the range nearest to 0."""
    name = _part(robot, rng)
    model = robot.spec().compile()
    low, high = model.joint(robot.part(name).hinges[0]).range
    return (Fault("jam", name, float(min(max(low, 0.0), high))),)


def _jam_angle(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    name = _hinge_part(robot, rng)
    model = robot.spec().compile()
    low, high = model.joint(robot.part(name).hinges[0]).range
    side = rng.choice((0.2, 0.8)) + rng.uniform(-0.1, 0.1)
    return (Fault("jam", name, round(float(low + side * (high - low)), 3)),)


def _sensor(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    return (Fault("dead-sensor", list(robot.touches)[rng.integers(len(robot.touches))]),)


def _lost_and_sensor(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    (limb,) = _lost(robot, rng)
    others = [name for name in robot.touches if name not in robot.part(limb.part).touches]
    return limb, Fault("dead-sensor", others[rng.integers(len(others))])


def _lost_and_jam(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    (limb,) = _lost(robot, rng)
    while True:
        (jam,) = _jam(robot, rng)
        if set(robot.part(jam.part).touches) != set(robot.part(limb.part).touches):
            return limb, jam


def _payload(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    """A payload above the middle of the root body, or near its front or back end."""
    end = ("back", "", "front")[rng.integers(3)]
    model = robot.spec().compile()
    length = float(model.geom_size[model.body(robot.root).geomadr[0], 0])
    forward = {"back": -0.9, "": 0.0, "front": 0.9}[end] + rng.uniform(-0.1, 0.1)
    place = (round(forward * length, 3), round(float(rng.uniform(-0.03, 0.03)), 3), 0.05)
    return (Fault("payload", end, round(rng.uniform(0.2, 0.5), 3), place=place),)


def _heavier(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    """A torso that is 30 % heavier, as a payload at its centre."""
    del rng
    model = robot.spec().compile()
    part = 0.3 * model.body(robot.root).mass[0] / model.body_mass.sum()
    return (Fault("payload", value=round(float(part), 3)),)


def _grip(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    feet = [part.name for part in robot.parts if part.body in robot.touches.values()]
    return (Fault("grip", feet[rng.integers(len(feet))], 0.1),)


def _backlash(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    hinge = robot.part(_hinge_part(robot, rng)).hinges[0]
    return (Fault("backlash", hinge, round(rng.uniform(0.1, 0.3), 3)),)


def _encoder(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    """An encoder that is not recorded; nothing else is wrong."""
    hinge = robot.hinges[rng.integers(len(robot.hinges))]
    return (Fault("encoder", hinge, encoders=str(rng.choice(("nan", "none")))),)


def _crossed(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    first, second = rng.choice(list(robot.motors), 2, replace=False)
    return (Fault("crossed", f"{first} {second}"),)


def _tether(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    weight = robot.spec().compile().body_mass.sum() * 9.81
    return (Fault("tether", value=float(weight * rng.uniform(0.3, 0.8))),)


def _heavy_limb(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    feet = list(robot.touches.values())
    return (Fault("heavy-limb", feet[rng.integers(len(feet))], float(rng.uniform(4, 7))),)


def _soft_ground(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    del robot
    return (Fault("soft-ground", value=float(rng.uniform(150, 400))),)


def _side_slope(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    del robot
    return (Fault("side-slope", value=_signed(rng, 0.12, 0.25)),)


def _short_range(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    hinge = robot.part(_hinge_part(robot, rng)).hinges[0]
    return (Fault("short-range", hinge, float(rng.uniform(0.1, 0.2))),)


def _with(*draws: Draw) -> Draw:
    def draw(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
        return tuple(fault for one in draws for fault in one(robot, rng))

    return draw


def _nothing(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    del robot, rng
    return ()


def _lost_nan(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    return _limb(robot, rng, ("nan",))


def _lost_none(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    return _limb(robot, rng, ("none",))


def _jam_there(robot: Robot, rng: np.random.Generator) -> tuple[Fault, ...]:
    """A jam at the angle at which the joint is at the onset."""
    return (Fault("jam", _hinge_part(robot, rng), float("nan")),)


_FRICTION = _single("friction", _environment, _between(0.35, 0.6))
_MOTOR = _single("motor", _part, _between(0.05, 0.5))
_SLOPE = _single("slope", _environment, _either_sign(0.1, 0.2))
_WIND = _single("wind", _environment, _either_sign(12, 25, digits=2))

CASES = {
    case.name: case
    for case in (
        Case("break", "paper", _lost),
        Case("jam", "paper", _jam),
        Case("sensor", "paper", _sensor, network=True),
        Case("break-debris", "paper", _lost_with_debris),
        Case("break+sensor", "paper", _lost_and_sensor, network=True),
        Case("break+jam", "paper", _lost_and_jam),
        Case("healthy", "healthy", _nothing),
        Case("jam-angle", "wide", _jam_angle),
        Case("motor", "wide", _MOTOR),
        Case("heavier", "wide", _heavier),
        Case("damping", "wide", _single("damping", _hinge_part, lambda _: 8.0)),
        Case("joint-friction", "wide", _single("joint-friction", _hinge_part, _between(0.15, 0.4))),
        Case("delay", "wide", _single("delay", _environment, _between(2, 3, digits=2))),
        Case(
            "encoder-offset",
            "wide",
            _single("encoder-offset", _hinge_part, _either_sign(0.1, 0.25)),
        ),
        Case("encoder-slip", "wide", _single("encoder-slip", _hinge_part, _either_sign(0.1, 0.25))),
        Case("grip", "wide", _grip),
        Case("backlash", "wide", _backlash),
        Case("friction", "default", _FRICTION),
        Case("slope", "default", _SLOPE),
        Case("wind", "default", _WIND),
        Case("payload", "default", _payload),
        Case("break+friction", "default", _with(_lost, _FRICTION)),
        Case("jam+slope", "default", _with(_jam, _SLOPE)),
        Case("motor+wind", "default", _with(_MOTOR, _WIND)),
        Case("break+payload", "default", _with(_lost, _payload)),
        Case("onset-jam", "onset", _jam_there, onset=True),
        Case("onset-motor", "onset", _single("motor", _part, _between(0.01, 0.3)), onset=True),
        Case("onset-break", "onset", _lost, onset=True),
        Case("break-nan", "lost-encoder", _lost_nan),
        Case("break-none", "lost-encoder", _lost_none),
        Case("encoder", "lost-encoder", _encoder),
        Case("crossed", "outside", _crossed),
        Case("tether", "outside", _tether),
        Case("heavy-limb", "outside", _heavy_limb),
        Case("soft-ground", "outside", _soft_ground),
        Case("side-slope", "outside", _side_slope),
        Case("short-range", "outside", _short_range),
    )
}
"""The cases by name."""

GROUPS = tuple(dict.fromkeys(case.group for case in CASES.values()))
"""The groups in the order of the tables."""
