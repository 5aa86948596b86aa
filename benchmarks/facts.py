"""Type of the results of measurements."""

from typing import Any

Facts = dict[str, Any]
"""JSON values by name."""
