"""How far planners drive from recorded people."""

from interdrive.traffic_realism.evaluation import realism
from interdrive.traffic_realism.result import Realism

__all__ = ["Realism", "realism"]
