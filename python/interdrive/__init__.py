"""interdrive: multi-agent driving simulation on real CommonRoad scenarios.

import interdrive as idr

run = idr.simulate("t_junction", agents="all")
print(run.outcomes.outcome)
"""

from __future__ import annotations

import importlib

#: Packages that are imported when they are first used.
_PACKAGES = ("batch_report", "criticality", "plots", "reference_drivers", "report")

# Modules are imported when a name is first used: `interdrive --help` needs none of them. Type checkers read the same
# from `__init__.pyi`, so that nothing is imported here and every module may import `interdrive._core`.
_HOME = {
    "Predictions": "_core",
    "Scene": "_core",
    "View": "_core",
    "__version__": "_core",
    "AgentSettings": "scenario.agent_settings",
    "GoalSettings": "scenario.agent_settings",
    "TrafficSettings": "traffic.settings",
    "STYLES": "config.styles",
    "batch": "batches",
    "read_batch": "batches",
    "Benchmark": "benchmarks",
    "benchmark": "benchmarks",
    "failures": "failure_search",
    "search": "failure_search",
    "InputError": "errors",
    "InterdriveError": "errors",
    "NoRouteError": "errors",
    "PredictorError": "errors",
    "ResultsError": "errors",
    "ScenarioSpec": "files",
    "join": "files",
    "read_scenario": "files",
    "read_source": "files",
    "scenario_from_commonroad": "files",
    "shipped_scenario": "files",
    "shipped_scenarios": "files",
    "write_scenario": "files",
    "Cc": "planners",
    "Frenet": "planners",
    "Fsm": "planners",
    "Idm": "planners",
    "IdmMobil": "planners",
    "Lawful": "planners",
    "Pdm": "planners",
    "Planner": "planners",
    "PlannerSettings": "planners",
    "R157": "planners",
    "Recorded": "planners",
    "Rollout": "planners",
    "Rss": "planners",
    "Trajectory": "planners",
    "VelocityAdjusting": "planners",
    "Calibration": "calibration",
    "calibrate": "calibration",
    "Realism": "traffic_realism",
    "realism": "traffic_realism",
    "PredictionEvaluation": "prediction_evaluation",
    "evaluate_predictors": "prediction_evaluation",
    "ConstantVelocity": "predictors",
    "GroundTruth": "predictors",
    "LaneFollowing": "predictors",
    "Neural": "predictors",
    "Predictor": "predictors",
    "PredictorSettings": "predictors",
    "Walenet": "predictors.walenet",
    "save": "results",
    "Run": "runs",
    "RunInterrupted": "runs",
    "load": "runs",
    "Scenario": "scenario",
    "Score": "scoring",
    "ScoringSettings": "scoring",
    "score": "panel",
    "Simulation": "simulation",
    "SimulationSettings": "config.schema",
    "ViewSettings": "native_settings",
    "SettingsSpec": "config.schema",
    "TrafficSpec": "config.schema",
    "PlannerSpec": "config.specs",
    "PredictorSpec": "config.specs",
    "PlannersSpec": "config.agent_config",
    "ViewsSpec": "config.agent_config",
    "simulate": "simulation",
    "write_solution": "files.solution",
    "CaseStudy": "studies",
    "case_study": "studies",
}

__all__ = sorted([*_PACKAGES, *_HOME])  # noqa: PLE0605 - the names of `__init__.pyi`


def __getattr__(name: str) -> object:
    if name in _PACKAGES:
        return importlib.import_module(f"interdrive.{name}")
    if name not in _HOME:
        raise AttributeError(f"module 'interdrive' has no attribute {name!r}")
    return getattr(importlib.import_module(f"interdrive.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return __all__
