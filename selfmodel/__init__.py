"""Damage diagnosis and recovery of legged robots from a few logged trials.

An implementation of Bongard & Lipson, *Automated Damage Diagnosis and Recovery for Remote
Robotics* (ICRA 2004), on MuJoCo and dm_control. "The paper" in every docstring is that article.

The names of this package are the public interface; each loads on first use.
"""

from typing import TYPE_CHECKING

import lazy_loader

if TYPE_CHECKING:
    from selfmodel.controllers.controller import Controller as Controller
    from selfmodel.diagnosis.comparator import Comparator as Comparator
    from selfmodel.diagnosis.comparator_contract import check_comparator as check_comparator
    from selfmodel.diagnosis.diagnosis import Diagnosis as Diagnosis
    from selfmodel.diagnosis.kind_contract import check_fault_kind as check_fault_kind
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
    from selfmodel.experiments.reality import simulated_robot as simulated_robot
    from selfmodel.faults.hypothesis import Hypothesis as Hypothesis
    from selfmodel.faults.kind import FaultKind as FaultKind
    from selfmodel.faults.registry import ALL_KINDS as ALL_KINDS, PAPER_KINDS as PAPER_KINDS
    from selfmodel.logs.reader import read_log as read_log
    from selfmodel.physical.environment_robot import EnvironmentRobot as EnvironmentRobot
    from selfmodel.physical.interface import PhysicalRobot as PhysicalRobot
    from selfmodel.recovery.recover import Recovery as Recovery
    from selfmodel.robot.robot import Robot as Robot
    from selfmodel.settings import Settings as Settings
    from selfmodel.simulation.simulator import Simulator as Simulator
    from selfmodel.trials.behaviour import Behaviour as Behaviour
    from selfmodel.trials.trial import Trial as Trial
    from selfmodel.version import __version__ as __version__
else:
    __getattr__, __dir__, __all__ = lazy_loader.attach(
        __name__,
        submod_attrs={
            "controllers.controller": ["Controller"],
            "diagnosis.comparator": ["Comparator"],
            "diagnosis.comparator_contract": ["check_comparator"],
            "diagnosis.diagnosis": ["Diagnosis"],
            "diagnosis.kind_contract": ["check_fault_kind"],
            "experiments.one_call": [
                "calibrate",
                "diagnose",
                "evolve_controller",
                "load_robot",
                "parse_hypothesis",
                "recover",
                "replay",
                "run_trial",
            ],
            "experiments.reality": ["simulated_robot"],
            "faults.hypothesis": ["Hypothesis"],
            "faults.kind": ["FaultKind"],
            "faults.registry": ["ALL_KINDS", "PAPER_KINDS"],
            "logs.reader": ["read_log"],
            "physical.environment_robot": ["EnvironmentRobot"],
            "physical.interface": ["PhysicalRobot"],
            "recovery.recover": ["Recovery"],
            "robot.robot": ["Robot"],
            "settings": ["Settings"],
            "simulation.simulator": ["Simulator"],
            "trials.behaviour": ["Behaviour"],
            "trials.trial": ["Trial"],
            "version": ["__version__"],
        },
    )
