"""Where agents move: mazes and the soccer field.

Importing this package registers ``replication/Maze-v0`` and ``replication/Soccer-v0`` with
Gymnasium.
"""

import gymnasium

gymnasium.register(
    id="replication/Maze-v0", entry_point="replication.envs.gym:MazeEnv", max_episode_steps=500
)
gymnasium.register(id="replication/Soccer-v0", entry_point="replication.envs.gym:SoccerEnv")
