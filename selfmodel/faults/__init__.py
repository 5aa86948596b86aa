"""The kinds of fault: what each means, which parts it can strike, what it does to a robot."""

from collections.abc import Mapping

from selfmodel.faults.broken import BROKEN
from selfmodel.faults.jammed import JAMMED
from selfmodel.faults.kind import Fault, Kind
from selfmodel.faults.neuron import SILENT_NEURON
from selfmodel.faults.sensor import FAILED_SENSOR

KINDS: Mapping[str, Kind] = {
    kind.name: kind for kind in (BROKEN, JAMMED, FAILED_SENSOR, SILENT_NEURON)
}
"""Every kind of fault, by the word that stands for it in notation."""

__all__ = ["KINDS", "Fault", "Kind"]
