"""Ablation study: every comparator diagnoses the same trials, on a grid of runs."""

from selfmodel.experiments.ablation.ablate import ablate
from selfmodel.experiments.ablation.plan import Ablation
from selfmodel.experiments.ablation.results import AblationResults, collect, write_results
from selfmodel.experiments.ablation.rows import AblationRow

__all__ = ["Ablation", "AblationResults", "AblationRow", "ablate", "collect", "write_results"]
