"""The comparators of selfmodel, by name."""

from collections.abc import Mapping

from selfmodel.comparators.forward_displacement import FORWARD_DISPLACEMENT
from selfmodel.comparators.gait_pattern import GAIT_PATTERN
from selfmodel.comparators.noisy_transfer import NOISY_TRANSFER
from selfmodel.comparators.paper_sensors import PAPER_SENSORS
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

DEFAULT = SEGMENT_PREDICTION
"""The comparator of a diagnosis if none is given."""

__all__ = [
    "COMPARATORS",
    "DEFAULT",
    "FORWARD_DISPLACEMENT",
    "GAIT_PATTERN",
    "NOISY_TRANSFER",
    "PAPER_SENSORS",
    "SEGMENT_PREDICTION",
    "SEGMENT_PREDICTION_ONBOARD",
    "SENSOR_SERIES",
]
