"""interdrive: multi-agent driving simulation on real CommonRoad scenarios.

import interdrive as idr

run = idr.simulate("t_junction", agents="all")
print(run.outcomes.outcome)
"""

from __future__ import annotations

import importlib

TYPE_CHECKING = False  # typing takes longer to import than this module
if TYPE_CHECKING:
    from typing import Any

    from interdrive import criticality, plots, report
    from interdrive._core import Predictions, Scene, View, __version__
    from interdrive.batches import batch, read_batch
    from interdrive.benchmarks import Benchmark, benchmark
    from interdrive.config.agent_config import PlannersSpec, ViewsSpec
    from interdrive.config.schema import SettingsSpec, SimulationSettings
    from interdrive.config.specs import PlannerSpec, PredictorSpec
    from interdrive.errors import InputError, InterdriveError, NoRouteError, PredictorError, ResultsError
    from interdrive.files import (
        ScenarioSpec,
        join,
        read_scenario,
        scenario_from_commonroad,
        shipped_scenario,
        shipped_scenarios,
        write_scenario,
    )
    from interdrive.files.solution import write_solution
    from interdrive.native_settings import ViewSettings
    from interdrive.planners import (
        Frenet,
        Idm,
        IdmMobil,
        Planner,
        PlannerSettings,
        Recorded,
        Trajectory,
        VelocityAdjusting,
    )
    from interdrive.prediction_evaluation import PredictionEvaluation, evaluate_predictors
    from interdrive.predictors import (
        ConstantVelocity,
        GroundTruth,
        LaneFollowing,
        Neural,
        Predictor,
        PredictorSettings,
    )
    from interdrive.predictors.walenet import Walenet
    from interdrive.results import Run, RunInterrupted, load, save
    from interdrive.scenario import Scenario
    from interdrive.scenario.agents import AgentSettings, GoalSettings
    from interdrive.scoring import Score, ScoringSettings, score
    from interdrive.simulation import Simulation, simulate
    from interdrive.studies import CaseStudy, case_study

#: Packages that are imported when they are first used.
_PACKAGES = ("criticality", "plots", "report")

# Modules are imported when a name is first used: `interdrive --help` needs none of them.
_HOME = {
    "Predictions": "_core",
    "Scene": "_core",
    "View": "_core",
    "__version__": "_core",
    "AgentSettings": "scenario.agents",
    "GoalSettings": "scenario.agents",
    "batch": "batches",
    "read_batch": "batches",
    "Benchmark": "benchmarks",
    "benchmark": "benchmarks",
    "InputError": "errors",
    "InterdriveError": "errors",
    "NoRouteError": "errors",
    "PredictorError": "errors",
    "ResultsError": "errors",
    "ScenarioSpec": "files",
    "join": "files",
    "read_scenario": "files",
    "scenario_from_commonroad": "files",
    "shipped_scenario": "files",
    "shipped_scenarios": "files",
    "write_scenario": "files",
    "Frenet": "planners",
    "Idm": "planners",
    "IdmMobil": "planners",
    "Planner": "planners",
    "PlannerSettings": "planners",
    "Recorded": "planners",
    "Trajectory": "planners",
    "VelocityAdjusting": "planners",
    "PredictionEvaluation": "prediction_evaluation",
    "evaluate_predictors": "prediction_evaluation",
    "ConstantVelocity": "predictors",
    "GroundTruth": "predictors",
    "LaneFollowing": "predictors",
    "Neural": "predictors",
    "Predictor": "predictors",
    "PredictorSettings": "predictors",
    "Walenet": "predictors.walenet",
    "load": "results",
    "save": "results",
    "Run": "results",
    "RunInterrupted": "results",
    "Scenario": "scenario",
    "Score": "scoring",
    "ScoringSettings": "scoring",
    "score": "scoring",
    "Simulation": "simulation",
    "SimulationSettings": "config.schema",
    "ViewSettings": "native_settings",
    "SettingsSpec": "config.schema",
    "PlannerSpec": "config.specs",
    "PredictorSpec": "config.specs",
    "PlannersSpec": "config.agent_config",
    "ViewsSpec": "config.agent_config",
    "simulate": "simulation",
    "write_solution": "files.solution",
    "CaseStudy": "studies",
    "case_study": "studies",
}

__all__ = [
    "AgentSettings",
    "Benchmark",
    "CaseStudy",
    "ConstantVelocity",
    "Frenet",
    "GoalSettings",
    "GroundTruth",
    "Idm",
    "IdmMobil",
    "InputError",
    "InterdriveError",
    "LaneFollowing",
    "Neural",
    "NoRouteError",
    "Planner",
    "PlannerSettings",
    "PlannerSpec",
    "PlannersSpec",
    "PredictionEvaluation",
    "Predictions",
    "Predictor",
    "PredictorError",
    "PredictorSettings",
    "PredictorSpec",
    "Recorded",
    "ResultsError",
    "Run",
    "RunInterrupted",
    "Scenario",
    "ScenarioSpec",
    "Scene",
    "Score",
    "ScoringSettings",
    "SettingsSpec",
    "Simulation",
    "SimulationSettings",
    "Trajectory",
    "VelocityAdjusting",
    "View",
    "ViewSettings",
    "ViewsSpec",
    "Walenet",
    "__version__",
    "batch",
    "benchmark",
    "case_study",
    "criticality",
    "evaluate_predictors",
    "join",
    "load",
    "plots",
    "read_batch",
    "read_scenario",
    "report",
    "save",
    "scenario_from_commonroad",
    "score",
    "shipped_scenario",
    "shipped_scenarios",
    "simulate",
    "write_scenario",
    "write_solution",
]


def __getattr__(name: str) -> Any:  # noqa: ANN401 - any of the names above
    if name in _PACKAGES:
        return importlib.import_module(f"interdrive.{name}")
    if name not in _HOME:
        raise AttributeError(f"module 'interdrive' has no attribute {name!r}")
    return getattr(importlib.import_module(f"interdrive.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return __all__
