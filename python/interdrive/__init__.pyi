# ruff: noqa: I001 - every name is exported as itself, those of a module in one line
from interdrive import (
    batch_report as batch_report,
    criticality as criticality,
    plots as plots,
    reference_drivers as reference_drivers,
    report as report,
)
from interdrive._core import Predictions as Predictions, Scene as Scene, View as View, __version__ as __version__
from interdrive.batches import batch as batch, read_batch as read_batch
from interdrive.benchmarks import Benchmark as Benchmark, benchmark as benchmark
from interdrive.calibration import Calibration as Calibration, calibrate as calibrate
from interdrive.config.agent_config import PlannersSpec as PlannersSpec, ViewsSpec as ViewsSpec
from interdrive.config.schema import (
    SettingsSpec as SettingsSpec,
    SimulationSettings as SimulationSettings,
    TrafficSpec as TrafficSpec,
)
from interdrive.config.styles import STYLES as STYLES
from interdrive.config.specs import PlannerSpec as PlannerSpec, PredictorSpec as PredictorSpec
from interdrive.errors import (
    InputError as InputError,
    InterdriveError as InterdriveError,
    NoRouteError as NoRouteError,
    PredictorError as PredictorError,
    ResultsError as ResultsError,
)
from interdrive.failure_search import failures as failures, search as search
from interdrive.files import (
    ScenarioSpec as ScenarioSpec,
    join as join,
    read_scenario as read_scenario,
    read_source as read_source,
    scenario_from_commonroad as scenario_from_commonroad,
    shipped_scenario as shipped_scenario,
    shipped_scenarios as shipped_scenarios,
    write_scenario as write_scenario,
)
from interdrive.files.solution import write_solution as write_solution
from interdrive.native_settings import ViewSettings as ViewSettings
from interdrive.panel import score as score
from interdrive.planners import (
    R157 as R157,
    Cc as Cc,
    Frenet as Frenet,
    Fsm as Fsm,
    Idm as Idm,
    IdmMobil as IdmMobil,
    Lawful as Lawful,
    Pdm as Pdm,
    Planner as Planner,
    PlannerSettings as PlannerSettings,
    Recorded as Recorded,
    Rollout as Rollout,
    Rss as Rss,
    Trajectory as Trajectory,
    VelocityAdjusting as VelocityAdjusting,
)
from interdrive.prediction_evaluation import (
    PredictionEvaluation as PredictionEvaluation,
    evaluate_predictors as evaluate_predictors,
)
from interdrive.predictors import (
    ConstantVelocity as ConstantVelocity,
    GroundTruth as GroundTruth,
    LaneFollowing as LaneFollowing,
    Neural as Neural,
    Predictor as Predictor,
    PredictorSettings as PredictorSettings,
)
from interdrive.predictors.walenet import Walenet as Walenet
from interdrive.results import save as save
from interdrive.runs import Run as Run, RunInterrupted as RunInterrupted, load as load
from interdrive.scenario import Scenario as Scenario
from interdrive.scenario.agent_settings import AgentSettings as AgentSettings, GoalSettings as GoalSettings
from interdrive.scoring import Score as Score, ScoringSettings as ScoringSettings
from interdrive.simulation import Simulation as Simulation, simulate as simulate
from interdrive.studies import CaseStudy as CaseStudy, case_study as case_study
from interdrive.traffic_realism import Realism as Realism, realism as realism
from interdrive.traffic.settings import TrafficSettings as TrafficSettings
