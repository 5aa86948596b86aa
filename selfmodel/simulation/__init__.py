"""Simulation of the self-model: rollouts, short predictions, calibration, replay."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from selfmodel.simulation.calibration import Calibration as Calibration, calibrate as calibrate
    from selfmodel.simulation.outcome import (
        SimulationResult as SimulationResult,
        SimulationStats as SimulationStats,
    )
    from selfmodel.simulation.requests import (
        ClosedLoop as ClosedLoop,
        Ensemble as Ensemble,
        Request as Request,
        Segments as Segments,
    )
    from selfmodel.simulation.simulator import Simulator as Simulator
    from selfmodel.simulation.trial_replay import Replay as Replay, replay as replay
else:
    __getattr__, __dir__, __all__ = lazy_loader.attach(
        __name__,
        submod_attrs={
            "calibration": ["Calibration", "calibrate"],
            "outcome": ["SimulationResult", "SimulationStats"],
            "requests": ["ClosedLoop", "Ensemble", "Request", "Segments"],
            "simulator": ["Simulator"],
            "trial_replay": ["Replay", "replay"],
        },
    )
