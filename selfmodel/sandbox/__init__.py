"""Limits of the work on files: the budget, and child processes that cannot exceed it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
