"""The comparators of selfmodel, by name."""

from collections.abc import Mapping

from selfmodel.comparators.gait_pattern import GAIT_PATTERN
from selfmodel.comparators.noisy_transfer import NOISY_TRANSFER
from selfmodel.comparators.paper import FORWARD_DISPLACEMENT, PAPER_SENSORS
from selfmodel.comparators.segment_prediction import SEGMENT_PREDICTION, SEGMENT_PREDICTION_ONBOARD
from selfmodel.comparators.sensor_series import SENSOR_SERIES
from selfmodel.diagnosis.comparator import Comparator

COMPARATORS: Mapping[str, Comparator] = {
    comparator.name: comparator
    for comparator in (
        FORWARD_DISPLACEMENT,
        PAPER_SENSORS,
        SENSOR_SERIES,
        GAIT_PATTERN,
        NOISY_TRANSFER,
        SEGMENT_PREDICTION,
        SEGMENT_PREDICTION_ONBOARD,
    )
}
"""All comparators of selfmodel, by name."""

PREFERENCE: tuple[Comparator, ...] = (
    SEGMENT_PREDICTION,
    SEGMENT_PREDICTION_ONBOARD,
    NOISY_TRANSFER,
    SENSOR_SERIES,
)
"""Comparators that ``auto`` chooses from, right most often across a reality gap first.

They can judge every trial that the other comparators can judge. Source: the rates of right
diagnoses in ``docs/results/comparators.md``."""

DEFAULT = PREFERENCE[0]
"""The comparator of trials with all signals."""

__all__ = [
    "COMPARATORS",
    "DEFAULT",
    "FORWARD_DISPLACEMENT",
    "GAIT_PATTERN",
    "NOISY_TRANSFER",
    "PAPER_SENSORS",
    "PREFERENCE",
    "SEGMENT_PREDICTION",
    "SEGMENT_PREDICTION_ONBOARD",
    "SENSOR_SERIES",
]
