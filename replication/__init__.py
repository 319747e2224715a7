"""Inverse reinforcement learning from correct and incorrect demonstrations, replicated.

The public interface::

    demos = load_demos(stored("open_maze"))  # or the path of your own file
    result = fit(demos, method="unified-incorrect", seed=1)
    result.save("result.json")

A name is imported when it is first used, so that the command `replicate` starts at once.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from replication.baselines import BASELINES
    from replication.demos.checks import DemoError
    from replication.demos.csv import read_csv
    from replication.demos.files import check_demos, load_demos, save_demos
    from replication.demos.lists import make_demos
    from replication.demos.maze_expert import demonstrate
    from replication.demos.minari import from_minari, to_minari
    from replication.demos.model import Demo, Demos
    from replication.envs.gym import MazeEnv
    from replication.envs.maze import Maze, MazeError
    from replication.envs.tasks.base import Task, TaskError
    from replication.envs.tasks.bins import Bins
    from replication.envs.tasks.gymnasium import GymTask
    from replication.envs.tasks.stepped import WrappedTask
    from replication.envs.tasks.table import TabularTask
    from replication.files import stored
    from replication.fitting import fit, fit_many
    from replication.irl import METHODS
    from replication.learned_reward import LearnedReward
    from replication.paper.params import Params
    from replication.recording.terminal import record
    from replication.result import Fit

__version__ = "0.1.0"

__all__ = [
    "BASELINES",
    "METHODS",
    "Bins",
    "Demo",
    "DemoError",
    "Demos",
    "Fit",
    "GymTask",
    "LearnedReward",
    "Maze",
    "MazeEnv",
    "MazeError",
    "Params",
    "TabularTask",
    "Task",
    "TaskError",
    "WrappedTask",
    "check_demos",
    "demonstrate",
    "fit",
    "fit_many",
    "from_minari",
    "load_demos",
    "make_demos",
    "read_csv",
    "record",
    "save_demos",
    "stored",
    "to_minari",
]

if not TYPE_CHECKING:  # a type checker would take it to know every name
    _MODULES = {
        "baselines": ("BASELINES",),
        "demos.checks": ("DemoError",),
        "demos.csv": ("read_csv",),
        "demos.files": ("check_demos", "load_demos", "save_demos"),
        "demos.maze_expert": ("demonstrate",),
        "demos.minari": ("from_minari", "to_minari"),
        "demos.model": ("Demo", "Demos"),
        "demos.lists": ("make_demos",),
        "recording.terminal": ("record",),
        "envs.tasks.bins": ("Bins",),
        "envs.gym": ("MazeEnv",),
        "envs.tasks.gymnasium": ("GymTask",),
        "envs.maze": ("Maze", "MazeError"),
        "envs.tasks.table": ("TabularTask",),
        "envs.tasks.base": ("Task", "TaskError"),
        "envs.tasks.stepped": ("WrappedTask",),
        "files": ("stored",),
        "fitting": ("fit", "fit_many"),
        "irl": ("METHODS",),
        "learned_reward": ("LearnedReward",),
        "paper.params": ("Params",),
        "result": ("Fit",),
    }

    def __getattr__(name):
        from importlib import import_module  # which takes longer than all of this

        for module, names in _MODULES.items():
            if name in names:
                return getattr(import_module(f"{__name__}.{module}"), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

    def __dir__():
        return [*globals(), *__all__]
