"""The cases: each draws its faults for a robot and a seed."""

import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.foreign.robots import Robot

NOTATION = {
    "lost": "break:{part}",
    "jam": "jam:{part}={value:.4f}",
    "motor": "motor:{part}={value:.3f}",
    "dead-sensor": "sensor:{part}",
    "friction": "friction={value:.3f}",
    "slope": "slope={value:.3f}",
    "wind": "wind={value:.2f}",
    "payload": "payload:{part}={value:.3f}",
    "damping": "damping:{part}={value:.2f}",
    "joint-friction": "joint-friction:{part}={value:.3f}",
    "delay": "delay={value:.2f}",
    "encoder-offset": "encoder-offset:{part}={value:.3f}",
    "encoder-slip": "encoder-offset:{part}=slip{value:.3f}",
    "grip": "grip:{part}={value:.3f}",
    "backlash": "backlash:{part}={value:.3f}",
}
"""Notation of each kind of fault that selfmodel has, or is to have. With ``encoder-slip``, the
servo uses the encoder with the offset; with ``encoder-offset``, it has another one."""

UNKNOWN = ("crossed", "tether", "heavy-limb", "soft-ground", "side-slope", "short-range")
"""Kinds of faults that no kind of selfmodel expresses."""

SILENT = ("encoder",)
"""Kinds that change the record and not the robot: no diagnosis has to name them."""


@dataclass(frozen=True)
class Fault:
    """A fault of a robot, of its environment, or of its recorder."""

    kind: str
    part: str = ""
    """Name of a part, hinge, sensor or body; empty for the environment."""
    value: float = 0.0
    """Severity in the unit of its notation; for the kinds of ``UNKNOWN`` as in ``model``."""
    encoders: str = "freezes"
    """Encoders of a lost limb: ``freezes``, ``follows`` the commands, ``nan``, or ``none``."""
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Position of a payload on the root body, m."""
    debris: bool = False
    """Whether a lost limb stays on the ground."""

    @property
    def notation(self) -> str:
        """The fault in selfmodel's notation; a kind that it does not have as ``outside:kind``."""
        if self.kind in UNKNOWN:
            return f"outside:{self.kind}"
        text = NOTATION[self.kind].format(part=self.part, value=self.value)
        return text.removesuffix("=0.0000").replace(":=", "=")


Faults = tuple[Fault, ...]
Draw = Callable[[Robot, np.random.Generator], Faults]


@dataclass(frozen=True)
class Case:
    """A case: those with the name ``onset-...`` begin in mid-trial."""

    name: str
    group: str
    draw: Draw


def stream(seed: int, *words: str) -> np.random.Generator:
    """Returns the generator of a random stream, named by words such as robot, case and purpose."""
    key = [zlib.crc32(word.encode()) for word in words]
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


def notation(faults: Faults) -> list[str]:
    """Returns the truth of a case: the notation of each fault that a diagnosis has to name."""
    return [fault.notation for fault in faults if fault.kind not in SILENT]


def faults_of(case: Case, robot: Robot, seed: int) -> Faults:
    """Returns the faults of a case; they do not depend on the gap."""
    return case.draw(robot, stream(seed, robot.name, case.name, "faults"))


def onset_of(case: Case, robot: Robot, seed: int) -> float | None:
    """Returns the time at which the faults begin, s; None if they hold from the start."""
    if case.group != "onset":
        return ONSETS.get(case.name)
    drawn = stream(seed, robot.name, case.name, "onset").uniform(3, 7)
    return round(round(drawn / robot.control_timestep) * robot.control_timestep, 6)


def _one_of(rng: np.random.Generator, names: list[str]) -> str:
    return names[rng.integers(len(names))]


def _part(robot: Robot, rng: np.random.Generator) -> str:
    return _one_of(rng, [part.name for part in robot.parts])


def _hinge_part(robot: Robot, rng: np.random.Generator) -> str:
    return _one_of(rng, [part.name for part in robot.parts if len(part.hinges) == 1])


def _hinge(robot: Robot, rng: np.random.Generator) -> str:
    return robot.part(_hinge_part(robot, rng)).hinges[0]


def _nowhere(_robot: Robot, _rng: np.random.Generator) -> str:
    return ""


Severity = Callable[[np.random.Generator], float]


def _always(value: float) -> Severity:
    return lambda _rng: value


def _between(low: float, high: float, digits: int | None = 3) -> Severity:
    return lambda rng: _rounded(rng.uniform(low, high), digits)


def _either_sign(low: float, high: float, digits: int | None = 3) -> Severity:
    return lambda rng: _rounded(float(rng.choice((-1, 1)) * rng.uniform(low, high)), digits)


def _rounded(value: float, digits: int | None) -> float:
    return value if digits is None else round(value, digits)


def _single(
    kind: str, part: Callable[[Robot, np.random.Generator], str], severity: Severity
) -> Draw:
    """Returns a draw of one fault: its part, and then its severity."""
    return lambda robot, rng: (Fault(kind, part(robot, rng), severity(rng)),)


def _limb(*encoders: str, debris: bool = False) -> Draw:
    def draw(robot: Robot, rng: np.random.Generator) -> Faults:
        part = _part(robot, rng)
        return (Fault("lost", part, encoders=str(rng.choice(encoders)), debris=debris),)

    return draw


def _together(*draws: Draw) -> Draw:
    return lambda robot, rng: tuple(fault for draw in draws for fault in draw(robot, rng))


def _range(robot: Robot, part: str) -> tuple[float, float]:
    low, high = robot.spec().compile().joint(robot.part(part).hinges[0]).range
    return float(low), float(high)


def _jam(robot: Robot, rng: np.random.Generator) -> Faults:
    """A jam at 0, or at the end of the range nearest to 0."""
    part = _part(robot, rng)
    low, high = _range(robot, part)
    return (Fault("jam", part, min(max(low, 0.0), high)),)


def _jam_angle(robot: Robot, rng: np.random.Generator) -> Faults:
    part = _hinge_part(robot, rng)
    low, high = _range(robot, part)
    side = rng.choice((0.2, 0.8)) + rng.uniform(-0.1, 0.1)
    return (Fault("jam", part, round(float(low + side * (high - low)), 3)),)


def _lost_and_sensor(robot: Robot, rng: np.random.Generator) -> Faults:
    (limb,) = _LOST(robot, rng)
    others = [name for name in robot.touches if name not in robot.part(limb.part).touches]
    return limb, Fault("dead-sensor", _one_of(rng, others))


def _lost_and_jam(robot: Robot, rng: np.random.Generator) -> Faults:
    (limb,) = _LOST(robot, rng)
    while True:
        (jam,) = _jam(robot, rng)
        if set(robot.part(jam.part).touches) != set(robot.part(limb.part).touches):
            return limb, jam


def _payload(robot: Robot, rng: np.random.Generator) -> Faults:
    """A payload above the middle of the root body, or near its front or back end."""
    end = ("back", "", "front")[rng.integers(3)]
    model = robot.spec().compile()
    length = float(model.geom_size[model.body(robot.root).geomadr[0], 0])
    forward = {"back": -0.9, "": 0.0, "front": 0.9}[end] + rng.uniform(-0.1, 0.1)
    place = (round(forward * length, 3), round(float(rng.uniform(-0.03, 0.03)), 3), 0.05)
    return (Fault("payload", end, round(rng.uniform(0.2, 0.5), 3), place=place),)


def _heavier(robot: Robot, _rng: np.random.Generator) -> Faults:
    """A torso that is 30 % heavier, as a payload at its centre."""
    model = robot.spec().compile()
    part = 0.3 * model.body(robot.root).mass[0] / model.body_mass.sum()
    return (Fault("payload", value=round(float(part), 3)),)


def _encoder(robot: Robot, rng: np.random.Generator) -> Faults:
    """An encoder that is not recorded; nothing else is wrong."""
    hinge = _one_of(rng, list(robot.hinges))
    return (Fault("encoder", hinge, encoders=str(rng.choice(("nan", "none")))),)


def _crossed(robot: Robot, rng: np.random.Generator) -> Faults:
    first, second = rng.choice(list(robot.motors), 2, replace=False)
    return (Fault("crossed", f"{first} {second}"),)


def _tether(robot: Robot, rng: np.random.Generator) -> Faults:
    weight = robot.spec().compile().body_mass.sum() * 9.81
    return (Fault("tether", value=float(weight * rng.uniform(0.3, 0.8))),)


def _touch(robot: Robot, rng: np.random.Generator) -> str:
    return _one_of(rng, list(robot.touches))


def _foot_part(robot: Robot, rng: np.random.Generator) -> str:
    feet = robot.touches.values()
    return _one_of(rng, [part.name for part in robot.parts if part.body in feet])


def _foot(robot: Robot, rng: np.random.Generator) -> str:
    return _one_of(rng, list(robot.touches.values()))


def _two_kilograms(robot: Robot, _rng: np.random.Generator) -> Faults:
    part = 2.0 / robot.spec().compile().body_mass.sum()
    return (Fault("payload", value=round(float(part), 3), place=(0.0, 0.0, 0.05)),)


def _thigh(robot: Robot, rng: np.random.Generator) -> str:
    """Returns a part that carries one other hinge."""
    carry = [part.name for part in robot.parts if len(part.beyond) == len(part.hinges) + 1]
    return _one_of(rng, carry)


_LOST = _limb("freezes", "follows")
_FRICTION = _single("friction", _nowhere, _between(0.35, 0.6))
_MOTOR = _single("motor", _part, _between(0.05, 0.5))
_SLOPE = _single("slope", _nowhere, _either_sign(0.1, 0.2))
_WIND = _single("wind", _nowhere, _either_sign(12, 25, digits=2))
_OFFSET = _either_sign(0.1, 0.25)

_GROUPS: dict[str, dict[str, Draw]] = {
    "paper": {
        "break": _LOST,
        "jam": _jam,
        "sensor": _single("dead-sensor", _touch, _always(0.0)),
        "break-debris": _limb("freezes", "follows", debris=True),
        "break+sensor": _lost_and_sensor,
        "break+jam": _lost_and_jam,
    },
    "healthy": {"healthy": _together()},
    "wide": {
        "jam-angle": _jam_angle,
        "motor": _MOTOR,
        "heavier": _heavier,
        "damping": _single("damping", _hinge_part, _always(8.0)),
        "joint-friction": _single("joint-friction", _hinge_part, _between(0.15, 0.4)),
        "delay": _single("delay", _nowhere, _between(2, 3, digits=2)),
        "encoder-offset": _single("encoder-offset", _hinge_part, _OFFSET),
        "encoder-slip": _single("encoder-slip", _hinge_part, _OFFSET),
        "grip": _single("grip", _foot_part, _always(0.1)),
        "backlash": _single("backlash", _hinge, _between(0.1, 0.3)),
    },
    "default": {
        "friction": _FRICTION,
        "slope": _SLOPE,
        "wind": _WIND,
        "payload": _payload,
        "break+friction": _together(_LOST, _FRICTION),
        "jam+slope": _together(_jam, _SLOPE),
        "motor+wind": _together(_MOTOR, _WIND),
        "break+payload": _together(_LOST, _payload),
    },
    "onset": {
        # At the angle at which the joint is at the onset.
        "onset-jam": _single("jam", _hinge_part, _always(float("nan"))),
        "onset-motor": _single("motor", _part, _between(0.01, 0.3)),
        "onset-break": _LOST,
    },
    "lost-encoder": {"break-nan": _limb("nan"), "break-none": _limb("none"), "encoder": _encoder},
    "long": {
        "long-motor": _single("motor", _thigh, _always(0.5)),
        "long-payload": _two_kilograms,
        "long-grip": _single("grip", _foot_part, _always(0.15)),  # friction 0.12 in place of 0.8
        "long-healthy": _together(),
    },
    "outside": {
        "crossed": _crossed,
        "tether": _tether,
        "heavy-limb": _single("heavy-limb", _foot, _between(4, 7, digits=None)),
        "soft-ground": _single("soft-ground", _nowhere, _between(150, 400, digits=None)),
        "side-slope": _single("side-slope", _nowhere, _either_sign(0.12, 0.25, digits=None)),
        "short-range": _single("short-range", _hinge, _between(0.1, 0.2, digits=None)),
    },
}

ONSETS = {"long-motor": 17.0, "long-grip": 5.0}
"""Onset of cases for trials of 30 s, s."""

GROUPS = tuple(_GROUPS)
"""The groups in the order of the tables."""

CASES = {
    name: Case(name, group, draw)
    for group, draws in _GROUPS.items()
    for name, draw in draws.items()
}
"""The cases by name."""
