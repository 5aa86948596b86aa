"""A fault, and what a kind of fault has to say about itself."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from selfmodel.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.embodiment import Embodiment


@dataclass(frozen=True, order=True)
class Fault:
    """One thing wrong with a robot.

    Attributes:
        kind: The word for its kind, a key of ``KINDS``.
        part: The joint, sensor or neuron it strikes.
        degree: How far, in the kind's own unit; 0 for a kind without degrees.
    """

    kind: str
    part: str
    degree: float = 0.0

    def __str__(self) -> str:
        term = f"{self.kind}:{self.part}"
        return f"{term}={self.degree!r}" if self.degree else term


def harmless(_fault: Fault, _other: Fault, _anatomy: Anatomy) -> bool:
    """A kind whose faults leave every other fault its effect."""
    return False


@dataclass(frozen=True)
class Kind:
    """One kind of fault.

    Attributes:
        name: The word for it in notation.
        parts: The names of the parts it can strike, in the order of the genome's third value.
        strike: Works the fault into an embodiment: its model, readings or neurons.
        absorbs: Whether the first fault, of this kind, leaves the second without any effect.
        degrees: Lowest and highest degree a part can have, or None where a degree has no meaning.
        unit: The unit of the degree.
        hypothesised: Whether a diagnosis may propose it; otherwise only a physical robot has it.
    """

    name: str
    parts: Callable[[Anatomy], tuple[str, ...]]
    strike: Callable[["Embodiment", Anatomy, Fault], None]
    absorbs: Callable[[Fault, Fault, Anatomy], bool] = harmless
    degrees: Callable[[Anatomy, str], tuple[float, float]] | None = None
    unit: str = ""
    hypothesised: bool = True
