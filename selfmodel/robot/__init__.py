"""A robot's MuJoCo model: its parts by name, its state by signal, its editable copy."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
