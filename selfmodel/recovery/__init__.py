"""The recovery loop: repair EA, choice of the next trial, database and journal."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
