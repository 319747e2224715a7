"""Inverse reinforcement learning: one loop for Algorithms 1 and 2, and a registry of methods."""

from replication.irl.loop import Snapshots, Trial, run_trial
from replication.irl.methods import METHODS, READINGS, Method, get_method

__all__ = ["METHODS", "READINGS", "Method", "Snapshots", "Trial", "get_method", "run_trial"]
