"""Studies with a known truth, on a grid that can be continued, and their statistics."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
