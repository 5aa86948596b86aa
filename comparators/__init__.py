"""The comparators, by name."""

from collections.abc import Mapping

from selfmodel.comparator import Comparator
from selfmodel.comparators.forward_displacement import FORWARD_DISPLACEMENT

COMPARATORS: Mapping[str, Comparator] = {
    comparator.name: comparator for comparator in (FORWARD_DISPLACEMENT,)
}
"""Every comparator that comes with selfmodel."""

DEFAULT = FORWARD_DISPLACEMENT.name

__all__ = ["COMPARATORS", "DEFAULT", "FORWARD_DISPLACEMENT"]
