"""Names of ``state``, until their importers are changed."""

from selfmodel.robot.state import Bind, FixedBase, FreeBase, Reader, SlidingBase, read_base

__all__ = ["Bind", "FixedBase", "FreeBase", "Reader", "SlidingBase", "read_base"]
