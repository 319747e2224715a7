"""Environments that feed both Gymnasium and the compiled learners.

Importing this package registers ``replication/Maze-v0`` and ``replication/Soccer-v0`` with
Gymnasium.
"""

import gymnasium

from replication.envs.maze import ACTIONS, Maze, MazeEnv, MazeError

__all__ = ["ACTIONS", "Maze", "MazeEnv", "MazeError"]

gymnasium.register(
    id="replication/Maze-v0",
    entry_point="replication.envs.maze:MazeEnv",
    max_episode_steps=500,
)
gymnasium.register(id="replication/Soccer-v0", entry_point="replication.envs.soccer_env:SoccerEnv")
