"""Inverse reinforcement learning from correct and incorrect demonstrations, replicated.

The public interface::

    demos = load_demos("data/demos/open_maze.json")
    result = fit(demos, method="unified-incorrect", seed=1)
    result.save("result.json")
"""

from replication.demos.checks import DemoError
from replication.demos.files import check_demos, load_demos, save_demos
from replication.demos.maze_expert import demonstrate
from replication.demos.model import Demo, Demos
from replication.envs.gym import MazeEnv
from replication.envs.maze import Maze, MazeError
from replication.fit import Fit, fit
from replication.irl import METHODS
from replication.paper.params import Params

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
