"""Robot soccer as a Gymnasium environment."""

import math
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from replication.envs import soccer
from replication.envs.chipmunk import FastSoccerWorld
from replication.envs.soccer import ACTIONS, N_STATES, SoccerParams

_PIXELS = 200  # a metre
_GRASS, _BALL, _GOAL = (44, 122, 62), (240, 140, 30), (230, 230, 230)
_ROBOT, _OBSTACLE, _FRONT = (40, 80, 200), (235, 200, 30), (214, 39, 40)


class SoccerEnv(gymnasium.Env[Any, Any]):
    """Robot soccer as a Gymnasium environment, registered as ``replication/Soccer-v0``.

    Observations are states, actions the numbers of `replication.envs.soccer.ACTIONS`. An episode
    terminates with a goal and is truncated when the simulated time is up. There is no chance in it.

    Parameters
    ----------
    params
        What the paper leaves open.
    weights
        Reward R(s, a) of taking action a in state s, float [state, action]; 0 by default.
    render_mode
        "rgb_array": uint8 [height, width, 3].

    Raises
    ------
    ValueError
        If the weights have another shape or are not finite, or the render mode is unknown.

    Examples
    --------
    >>> env = gymnasium.make("replication/Soccer-v0")
    >>> state, _ = env.reset(seed=1)
    >>> env.step(ACTIONS.index("forward"))[0] == state
    False
    """

    # Gymnasium declares this as an instance variable, so it cannot be a ClassVar here.
    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 2}  # noqa: RUF012

    def __init__(
        self,
        params: SoccerParams | None = None,
        weights: ArrayLike | None = None,
        render_mode: str | None = None,
    ) -> None:
        shape = (N_STATES, len(ACTIONS))
        self.weights = np.zeros(shape) if weights is None else np.array(weights, np.float64)
        if self.weights.shape != shape or not np.isfinite(self.weights).all():
            raise ValueError(f"weights must be finite numbers {shape}, not {self.weights.shape}")
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"unknown render mode {render_mode!r}; known: rgb_array")
        self.render_mode = render_mode
        self.world = FastSoccerWorld(params)
        self.observation_space = gymnasium.spaces.Discrete(N_STATES)
        self.action_space = gymnasium.spaces.Discrete(len(ACTIONS))
        self._state: int | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[int, dict[str, Any]]:
        """Put everything in its place; the environment draws nothing from its seed."""
        super().reset(seed=seed)
        self._state = self.world.reset()
        return self._state, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        """Take a decision; returns (state, reward, terminated, truncated, info)."""
        if self._state is None:
            raise gymnasium.error.ResetNeeded("call reset() before the first step()")
        if not self.action_space.contains(action):
            raise gymnasium.error.InvalidAction(f"there is no action {action!r}; actions are 0..4")
        reward = self.weights.item(self._state, action)
        self._state, scored, timed_out = self.world.step(action)
        return self._state, reward, scored, timed_out, {"time": self.world.time}

    def render(self) -> Any:
        """Draw the field from above; None without a render mode."""
        return self._image() if self.render_mode else None

    def _image(self) -> NDArray[np.uint8]:
        width = soccer.WIDTH + 2 * soccer.BALL_RADIUS
        y, x = np.mgrid[soccer.HEIGHT : 0 : -1 / _PIXELS, 0 : width : 1 / _PIXELS]
        image = np.full((*x.shape, 3), _GRASS, np.uint8)
        image[(x > soccer.WIDTH) & (soccer.GATE[0] < y) & (y < soccer.GATE[1])] = _GOAL

        def draw(pose: tuple[float, float, float], colour: tuple[int, int, int]) -> None:
            along_x, along_y = math.cos(pose[2]), math.sin(pose[2])
            ahead = (x - pose[0]) * along_x + (y - pose[1]) * along_y
            aside = (y - pose[1]) * along_x - (x - pose[0]) * along_y
            inside = np.maximum(np.abs(ahead), np.abs(aside)) < soccer.ROBOT_SIDE / 2
            image[inside] = colour
            image[inside & (ahead > soccer.ROBOT_SIDE / 4)] = _FRONT

        for pose in self.world.obstacles:
            draw(pose, _OBSTACLE)
        draw(self.world.pose, _ROBOT)
        ball = np.hypot(x - self.world.ball[0], y - self.world.ball[1]) < soccer.BALL_RADIUS
        image[ball] = _BALL
        return image
