"""Silent hidden neuron: a fault of the controller, which no diagnosis may propose."""

from typing import TYPE_CHECKING

from selfmodel.controllers.network import MAX_HIDDEN_NEURONS
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.robot.anatomy import Anatomy

if TYPE_CHECKING:
    from selfmodel.robot.embodiment import Embodiment


def _parts(_anatomy: Anatomy) -> tuple[str, ...]:
    # Neurons of the largest network: the controller, and so its number of neurons, is unknown.
    return tuple(str(neuron) for neuron in range(MAX_HIDDEN_NEURONS))


def _apply(embodiment: "Embodiment", _anatomy: Anatomy, fault: Fault) -> None:
    embodiment.silent_neurons.add(int(fault.part))


SILENT_NEURON = FaultKind(
    name="neuron", keyword="neuron", parts=_parts, apply=_apply, searchable=False
)


def silent_neurons(hypothesis: Hypothesis) -> frozenset[int]:
    """Returns the indices of the hidden neurons that are silent under a hypothesis."""
    return frozenset(int(fault.part) for fault in hypothesis.faults if fault.kind is SILENT_NEURON)
