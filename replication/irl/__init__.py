"""Inverse reinforcement learning: one loop for Algorithms 1 and 2, and a registry of methods."""

from replication.irl.loop import Snapshots, Trial, iterate, run
from replication.irl.methods import METHODS, READINGS, Method, get_method

__all__ = ["METHODS", "READINGS", "Method", "Snapshots", "Trial", "get_method", "iterate", "run"]
