"""Public functions, and studies with a known truth on a grid that can be resumed."""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from selfmodel.experiments.grid import Job as Job, finished as finished, run_grid as run_grid
    from selfmodel.experiments.one_call import (
        calibrate as calibrate,
        diagnose as diagnose,
        evolve_controller as evolve_controller,
        load_robot as load_robot,
        parse_hypothesis as parse_hypothesis,
        recover as recover,
        replay as replay,
        run_trial as run_trial,
    )
    from selfmodel.experiments.reality import (
        draw_reality as draw_reality,
        simulated_robot as simulated_robot,
    )
else:
    __getattr__, __dir__, __all__ = lazy_loader.attach(
        __name__,
        submod_attrs={
            "grid": ["Job", "finished", "run_grid"],
            "one_call": [
                "calibrate",
                "diagnose",
                "evolve_controller",
                "load_robot",
                "parse_hypothesis",
                "recover",
                "replay",
                "run_trial",
            ],
            "reality": ["draw_reality", "simulated_robot"],
        },
    )
