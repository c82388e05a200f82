"""Runs from a scenario, step by step."""

from interdrive.simulation.simulation import Simulation, reachable_agents, simulate

__all__ = ["Simulation", "reachable_agents", "simulate"]
