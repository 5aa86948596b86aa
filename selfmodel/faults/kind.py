"""A fault, and what a kind of fault or of environment has to say about itself."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from selfmodel.arrays import FloatArray
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from mujoco import MjSpec

    from selfmodel.robot.embodiment import Embodiment

Values = TypeVar("Values")

ENVIRONMENT = ""
"""The part that an environment strikes: the world, which notation does not name."""


def joints(anatomy: Anatomy) -> tuple[str, ...]:
    """Returns the names of the joints that can fail."""
    return tuple(joint.name for joint in anatomy.joints)


def environment_part(_anatomy: Anatomy) -> tuple[str, ...]:
    """The parts of a kind of environment."""
    return (ENVIRONMENT,)


def absorbs_nothing(_fault: "Fault", _other: "Fault", _anatomy: Anatomy) -> bool:
    """A kind whose faults leave every other fault its effect."""
    return False


def uniform_bounds(lowest: float, highest: float) -> Callable[[Anatomy, str], tuple[float, float]]:
    """Returns the bounds of the degree of a kind for which all parts are alike."""
    return partial(_same_for_all, (lowest, highest))


def uniform_levels(*levels: float) -> Callable[[Anatomy, str], tuple[float, ...]]:
    """Returns the levels of a kind for which all parts are alike."""
    return partial(_same_for_all, levels)


def _same_for_all(values: Values, _anatomy: Anatomy, _part: str) -> Values:
    return values


@dataclass(frozen=True, order=True, kw_only=True)
class FaultKind:
    """One kind of fault or of environment; known, compared and sorted by its name.

    In notation, a fault is ``keyword``, ``keyword:part``, ``keyword=severity`` or
    ``keyword:part=severity``, with the prefix in front of the severity's number. Kinds may share
    a keyword, but not keyword and prefix:
    ``sensor:X`` and ``sensor:X=gain0.2`` are of two kinds.

    Attributes:
        name: What it is called where kinds are chosen, such as ``sensor-gain``.
        word: The word for it in notation, such as ``sensor``.
        strike: Works the fault into an embodiment: its model, readings or neurons. It keeps the
            layout of the model. Faults strike in the order of their kinds' names.
        reshape: Works the fault into the robot's specification before that is compiled, given the
            seed of what is random: for what a compiled model cannot be edited into. What MjData
            holds must keep its sizes all the same.
        feel: Works into an embodiment what the feet of a robot felt of the ground in a trial, given
            the points, ``(n, 3)``, world frame, m: for what is random, and known only where the
            robot has been. It is asked when stretches of that trial are predicted.
        parts: The names of the parts it can strike, in the order of the genome's third value; an
            environment strikes ``ENVIRONMENT`` alone.
        absorbs: Whether the first fault, of this kind, leaves the second without any effect.
        degrees: Lowest and highest degree a part can have, or None where a degree has no meaning.
        levels: The degrees that a genome or a local search proposes for a part, in the order of
            the genome's fourth value.
        special: Degrees at which a fault of this kind is one of another kind, without a degree, or
            None, which is nothing at all.
        alone: Degrees at which a fault of this kind is one of another kind, without a degree, as
            long as there is nothing else that such a one would absorb: a sensor with a gain of 0
            has failed, unless it has a bias too.
        prefix: Letters in front of the degree's number in notation.
        unit: The unit of the degree.
        affects_dynamics: Whether it changes how a robot moves under given commands; if not, it
            changes readings only, and needs no simulation of its own where the commands are given.
        searchable: Whether a diagnosis may propose it; otherwise only a physical robot has it.
    """

    name: str
    keyword: str = field(compare=False)
    apply: Callable[["Embodiment", Anatomy, "Fault"], None] = field(compare=False, repr=False)
    edit_spec: Callable[["MjSpec", "Fault", int], None] | None = field(
        default=None, compare=False, repr=False
    )
    feel: Callable[["Embodiment", "Fault", FloatArray], None] | None = field(
        default=None, compare=False, repr=False
    )
    parts: Callable[[Anatomy], tuple[str, ...]] = field(
        default=environment_part, compare=False, repr=False
    )
    absorbs: Callable[["Fault", "Fault", Anatomy], bool] = field(
        default=absorbs_nothing, compare=False, repr=False
    )
    severity_bounds: Callable[[Anatomy, str], tuple[float, float]] | None = field(
        default=None, compare=False, repr=False
    )
    levels: Callable[[Anatomy, str], tuple[float, ...]] = field(
        default=uniform_levels(0.0), compare=False, repr=False
    )
    special: Mapping[float, "FaultKind | None"] = field(
        default_factory=dict, compare=False, repr=False
    )
    alone: Mapping[float, "FaultKind"] = field(default_factory=dict, compare=False, repr=False)
    prefix: str = field(default="", compare=False, repr=False)
    unit: str = field(default="", compare=False, repr=False)
    affects_dynamics: bool = field(default=True, compare=False, repr=False)
    searchable: bool = field(default=True, compare=False, repr=False)

    @property
    def others(self) -> tuple["FaultKind", ...]:
        """The kinds that a fault of this kind is of at some degree."""
        found = (*self.special.values(), *self.alone.values())
        return tuple(dict.fromkeys(kind for kind in found if kind is not None))

    @property
    def without_severity(self) -> "FaultKind":
        """The kind that a fault of this kind is at one of its degrees, if any; else this one."""
        return self.others[0] if self.others else self

    def candidates(self, anatomy: Anatomy) -> tuple["Fault", ...]:
        """Returns every fault that a genome or a local search proposes: each part, each level."""
        return tuple(
            Fault(self, part, severity)
            for part in self.parts(anatomy)
            for severity in self.levels(anatomy, part)
        )


@dataclass(frozen=True, order=True)
class Fault:
    """One thing that is not as the model says, with the robot or with the world.

    Attributes:
        kind: What kind of thing.
        part: The joint, sensor or neuron it strikes; ``ENVIRONMENT`` for an environment.
        severity: How far, in the kind's own unit; 0 for a kind without degrees.
    """

    kind: FaultKind
    part: str
    severity: float = 0.0

    def __str__(self) -> str:
        term = f"{self.kind.keyword}:{self.part}" if self.part else self.kind.keyword
        return (
            term
            if self.kind.severity_bounds is None
            else f"{term}={self.kind.prefix}{self.severity!r}"
        )

    @property
    def settled(self) -> "Fault | None":
        """The same in the fewest words; None where its degree says that nothing is wrong."""
        if self.severity not in self.kind.special:
            return self
        kind = self.kind.special[self.severity]
        return None if kind is None else Fault(kind, self.part)

    @property
    def settled_alone(self) -> "Fault":
        """The same in the fewest words where nothing else is wrong with the part."""
        kind = self.kind.alone.get(self.severity)
        return self if kind is None else Fault(kind, self.part)
