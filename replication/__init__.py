"""Inverse reinforcement learning from correct and incorrect demonstrations, replicated.

The public interface::

    demos = load_demos("data/demos/open_maze.json")
    result = fit(demos, method="unified-incorrect", seed=1)
    result.save("result.json")
"""

from replication.demos import Demo, DemoError, Demos, check_demos, load_demos, save_demos
from replication.envs.maze import Maze, MazeEnv, MazeError
from replication.expert import demonstrate
from replication.fit import Fit, fit
from replication.irl import METHODS
from replication.params import Params

__version__ = "0.1.0"

__all__ = [
    "METHODS",
    "Demo",
    "DemoError",
    "Demos",
    "Fit",
    "Maze",
    "MazeEnv",
    "MazeError",
    "Params",
    "check_demos",
    "demonstrate",
    "fit",
    "load_demos",
    "save_demos",
]
