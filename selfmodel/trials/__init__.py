"""The record of a run: its signals, its plan, and arithmetic on the signals."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
