"""Names of ``contacts``, until their importers are changed."""

from selfmodel.robot.contacts import reaches_ground

__all__ = ["reaches_ground"]
