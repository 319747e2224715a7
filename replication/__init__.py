"""Inverse reinforcement learning from correct and incorrect demonstrations, replicated.

The public interface::

    demos = load_demos("data/demos/open_maze.json")
    result = fit(demos, method="unified-incorrect", seed=1)
    result.save("result.json")

A name is imported when it is first used, so that the command `replicate` starts at once.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from replication.demos.checks import DemoError
    from replication.demos.csv import read_csv
    from replication.demos.files import check_demos, load_demos, save_demos
    from replication.demos.maze_expert import demonstrate
    from replication.demos.minari import from_minari, to_minari
    from replication.demos.model import Demo, Demos
    from replication.demos.terminal import record
    from replication.envs.gym import MazeEnv
    from replication.envs.maze import Maze, MazeError
    from replication.fitting import Fit, fit
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
    "from_minari",
    "load_demos",
    "read_csv",
    "record",
    "save_demos",
    "to_minari",
]

if not TYPE_CHECKING:  # a type checker would take it to know every name
    _MODULES = {
        "demos.checks": ("DemoError",),
        "demos.csv": ("read_csv",),
        "demos.files": ("check_demos", "load_demos", "save_demos"),
        "demos.maze_expert": ("demonstrate",),
        "demos.minari": ("from_minari", "to_minari"),
        "demos.model": ("Demo", "Demos"),
        "demos.terminal": ("record",),
        "envs.gym": ("MazeEnv",),
        "envs.maze": ("Maze", "MazeError"),
        "fitting": ("Fit", "fit"),
        "irl": ("METHODS",),
        "paper.params": ("Params",),
    }

    def __getattr__(name):
        from importlib import import_module  # which takes longer than all of this

        for module, names in _MODULES.items():
            if name in names:
                return getattr(import_module(f"{__name__}.{module}"), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

    def __dir__():
        return [*globals(), *__all__]
