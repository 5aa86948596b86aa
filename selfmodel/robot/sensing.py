"""Names of ``state``, until their importers are changed."""

from selfmodel.robot.state import SensorNoise, SensorReader

__all__ = ["SensorNoise", "SensorReader"]
