"""Names of ``contacts``, until their importers are changed."""

from selfmodel.robot.contacts import penetration_depths

__all__ = ["penetration_depths"]
