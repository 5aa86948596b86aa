"""Salvage of a damaged or unfinished log: its complete steps in a new log.

``rescue`` searches the file for intact records (``findings``), ``belonging`` selects those of one
trial, ``steps`` selects the complete control steps, and ``new_log`` writes them.
"""

from selfmodel.logs.salvage.belonging import Discarded
from selfmodel.logs.salvage.new_log import Salvaged, salvage, salvageable_steps

__all__ = ["Discarded", "Salvaged", "salvage", "salvageable_steps"]
