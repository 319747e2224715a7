"""The learner where chance moves, too, in plain Python: the definition that fast code must match.

:mod:`replication.learning.chance` has the same two functions, many times faster, and is tested to
return the same bits. It differs from :mod:`replication.learning.reference` in three ways: a move
and the start may have several outcomes, any number of states end an episode, and Eq. 1 is always
computed in 64 bits, each operation rounded (ARITHMETIC = ``double``).

Possible outcomes are a list of (bound, state). If there are several, the high half of **one** more
draw chooses the first whose bound is above it; a single one takes no draw. So a table without
chance has the bits of the other learner.
"""

from replication.learning.reference import choose, double, draw

Outcomes = list[tuple[int, int]]


def learn(
    outcomes: list[list[Outcomes]],
    starts: Outcomes,
    ends: list[bool],
    weights: list[list[float]],
    q: list[list[float]],
    stream: list[int],
    *,
    episodes: int,
    horizon: int,
    beta: float,
    gamma: float,
    epsilon: float,
    tolerance: float = 0.0,
    random_ties: bool = True,
) -> tuple[list[list[float]], list[int], int, int]:
    """Learn Q by epsilon-greedy Q-learning (Eq. 1) on the reward ``weights``.

    An episode ends on reaching a state that ``ends`` it, which is worth 0, or after ``horizon``
    steps; such a time-out is not terminal, so its target bootstraps like any other. Returns the new
    Q, the stream after the last draw, the number of steps, and that of collisions: steps that ended
    where they began.
    """
    q, stream, steps, collisions = [row[:] for row in q], stream[:], 0, 0
    for _ in range(episodes):
        state = land(starts, stream)
        for _ in range(horizon):
            action = choose(q[state], draw(stream), epsilon, random_ties, tolerance)
            successor = land(outcomes[state][action], stream)
            value = 0.0 if ends[successor] else max(q[successor])
            q[state][action] = double(q[state][action], weights[state][action], value, beta, gamma)
            steps += 1
            collisions += successor == state
            state = successor
            if ends[state]:
                break
    return q, stream, steps, collisions


def roll_out(
    outcomes: list[list[Outcomes]],
    starts: Outcomes,
    ends: list[bool],
    q: list[list[float]],
    stream: list[int],
    *,
    horizon: int,
    tolerance: float = 0.0,
    random_ties: bool = True,
) -> tuple[list[int], list[int], list[int]]:
    """Follow the greedy policy of Q until a state ends the episode, for ``horizon`` steps at most.

    Returns the T + 1 states, the T actions and the stream after the last draw.
    """
    stream = stream[:]
    states, actions = [land(starts, stream)], list[int]()
    while len(actions) < horizon:
        actions.append(choose(q[states[-1]], draw(stream), 0.0, random_ties, tolerance))
        states.append(land(outcomes[states[-1]][actions[-1]], stream))
        if ends[states[-1]]:
            break
    return states, actions, stream


def land(outcomes: Outcomes, stream: list[int]) -> int:
    """Return the state that chance takes of the possible ones; the stream advances if need be."""
    if len(outcomes) == 1:
        return outcomes[0][1]
    high = draw(stream) >> 32
    return next(state for bound, state in outcomes if high < bound)
