"""A silent hidden neuron: a fault of the physical robot that no hypothesis can express."""

from typing import TYPE_CHECKING

from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment


def _parts(anatomy: Anatomy) -> tuple[str, ...]:
    return tuple(str(neuron) for neuron in range(anatomy.neurons))


def _apply(embodiment: "Embodiment", _anatomy: Anatomy, fault: Fault) -> None:
    embodiment.neurons[int(fault.part)] = 0.0


SILENT_NEURON = FaultKind(
    name="neuron", keyword="neuron", parts=_parts, apply=_apply, searchable=False
)
