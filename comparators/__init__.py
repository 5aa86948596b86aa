"""The comparators, by name."""

from collections.abc import Mapping

from selfmodel.comparator import Comparator
from selfmodel.comparators.forward_displacement import FORWARD_DISPLACEMENT
from selfmodel.comparators.segment_prediction import (
    SEGMENT_PREDICTION,
    SEGMENT_PREDICTION_ONBOARD,
)

COMPARATORS: Mapping[str, Comparator] = {
    comparator.name: comparator
    for comparator in (
        FORWARD_DISPLACEMENT,
        SEGMENT_PREDICTION,
        SEGMENT_PREDICTION_ONBOARD,
    )
}
"""Every comparator that comes with selfmodel."""

DEFAULT = FORWARD_DISPLACEMENT.name

__all__ = [
    "COMPARATORS",
    "DEFAULT",
    "FORWARD_DISPLACEMENT",
    "SEGMENT_PREDICTION",
    "SEGMENT_PREDICTION_ONBOARD",
]
