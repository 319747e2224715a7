"""Other ways to learn from demonstrations, beside which the paper's method is held."""

from replication.baselines.condition import BaselineCondition
from replication.baselines.problem import Problem, table_of
from replication.baselines.registry import BASELINES, find_method

__all__ = ["BASELINES", "BaselineCondition", "Problem", "find_method", "table_of"]
