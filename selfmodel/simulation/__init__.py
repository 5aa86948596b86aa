"""Simulation of the self-model: rollouts, short predictions, calibration, replay."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
