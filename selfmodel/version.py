"""The version of selfmodel."""

from importlib.metadata import version

__version__ = version("selfmodel")
