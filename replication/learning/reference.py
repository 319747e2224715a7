"""The learner in plain Python, one trial at a time: the definition that fast code must match.

:mod:`replication.learning.qlearning` has the same two functions, many times faster, and is tested
to return the same bits. All tables are lists of rows, ``table[state][action]``. A random stream is
a list of four 64-bit words, the state of a xoshiro256++ generator [1]_.

Each step takes **one** 64-bit draw. Its high half decides whether to explore, and its low half
which of the candidates is taken: all actions if exploring, else those of greatest value.

Eq. 1 multiplies and adds twice. How the results are rounded is a choice (ARITHMETIC): ``double``
rounds each operation to 64 bits, as Python does; ``fused`` rounds a product and the sum that it
enters once, as compilers do that contract both to one instruction; ``single`` rounds to 32 bits.

References
----------
.. [1] D. Blackman and S. Vigna, "Scrambled linear pseudorandom number generators", ACM
   Transactions on Mathematical Software 47 (4), 2021.
"""

from fractions import Fraction

import numpy as np

WORD = 2**64 - 1
HALF = 2**32


def learn(
    next_state: list[list[int]],
    weights: list[list[float]],
    q: list[list[float]],
    stream: list[int],
    *,
    start: int,
    goal: int,
    episodes: int,
    horizon: int,
    beta: float,
    gamma: float,
    epsilon: float,
    tolerance: float = 0.0,
    random_ties: bool = True,
    arithmetic: str = "double",
) -> tuple[list[list[float]], list[int], int, int]:
    """Learn Q by epsilon-greedy Q-learning (Eq. 1) on the reward ``weights``.

    An episode ends on reaching ``goal``, which is worth 0 (choice GOAL-VALUE), or after ``horizon``
    steps; such a time-out is not terminal, so its target bootstraps like any other. Returns the new
    Q, the stream after the last draw, the number of steps, and that of collisions: steps that ended
    where they began.

    Examples
    --------
    A corridor of three states: action 0 stays, action 1 moves on, and moving on is worth 1.

    >>> q, _, steps, collisions = learn(
    ...     [[0, 1], [1, 2], [2, 2]],
    ...     [[0.0, 1.0]] * 3,
    ...     [[0.0, 0.5]] * 3,
    ...     [1, 2, 3, 4],
    ...     start=0,
    ...     goal=2,
    ...     episodes=1,
    ...     horizon=9,
    ...     beta=1.0,
    ...     gamma=0.5,
    ...     epsilon=0.0,
    ... )
    >>> q, steps, collisions
    ([[0.0, 1.25], [0.0, 1.0], [0.0, 0.5]], 2, 0)
    """
    q, stream, steps, collisions = [row[:] for row in q], stream[:], 0, 0
    if arithmetic == "single":
        q = [[float(np.float32(value)) for value in row] for row in q]
    for _ in range(episodes):
        state = start
        for _ in range(horizon):
            action = choose(q[state], draw(stream), epsilon, random_ties, tolerance)
            successor = next_state[state][action]
            value = max(q[successor]) if successor != goal else 0.0
            q[state][action] = ROUNDED[arithmetic](
                q[state][action], weights[state][action], value, beta, gamma
            )
            steps += 1
            collisions += successor == state
            state = successor
            if state == goal:
                break
    return q, stream, steps, collisions


def double(q: float, reward: float, value: float, beta: float, gamma: float) -> float:
    """Return the new Q(s, a) by Eq. 1, each operation rounded to 64 bits."""
    target = reward + gamma * value
    return q + beta * (target - q)


def fused(q: float, reward: float, value: float, beta: float, gamma: float) -> float:
    """Return the same, each product and the sum that it enters rounded once."""
    target = fma(gamma, value, reward)
    return fma(beta, target - q, q)


def single(q: float, reward: float, value: float, beta: float, gamma: float) -> float:
    """Return the same, numbers and operations rounded to 32 bits."""
    return float(double(*map(np.float32, (q, reward, value, beta, gamma))))  # type: ignore[arg-type]


ROUNDED = {"double": double, "fused": fused, "single": single}
"""How Eq. 1 is rounded (choice ARITHMETIC)."""


def fma(a: float, b: float, c: float) -> float:
    """Return a b + c, rounded once."""
    exact = Fraction(a) * Fraction(b) + Fraction(c)
    return float(exact) if exact else a * b + c  # a zero of the right sign


def roll_out(
    next_state: list[list[int]],
    q: list[list[float]],
    stream: list[int],
    *,
    start: int,
    goal: int,
    horizon: int,
    tolerance: float = 0.0,
    random_ties: bool = True,
) -> tuple[list[int], list[int], list[int]]:
    """Follow the greedy policy of Q from ``start`` until ``goal``, for at most ``horizon`` steps.

    Returns the T + 1 states, the T actions and the stream after T draws.
    """
    stream, states = stream[:], [start]
    actions: list[int] = []
    while len(actions) < horizon:
        actions.append(choose(q[states[-1]], draw(stream), 0.0, random_ties, tolerance))
        states.append(next_state[states[-1]][actions[-1]])
        if states[-1] == goal:
            break
    return states, actions, stream


def choose(
    row: list[float], word: int, epsilon: float, random_ties: bool, tolerance: float = 0.0
) -> int:
    """Pick an action from a state's values by one 64-bit random word.

    The probability of exploring is ``epsilon`` to within 2**-33, and that of each of k candidates
    is 1 / k to within 2**-32.
    """
    high, low = divmod(word, HALF)
    if high < round(epsilon * HALF):
        candidates = list(range(len(row)))
    else:
        least = max(row) - tolerance * abs(max(row))
        candidates = [action for action, value in enumerate(row) if value >= least]
        if not random_ties:
            candidates = candidates[:1]
    return candidates[low * len(candidates) // HALF]


def draw(stream: list[int]) -> int:
    """Return the next 64-bit word of a xoshiro256++ stream, which is advanced in place."""
    s0, s1, s2, s3 = stream
    word = rotate((s0 + s3) & WORD, 23) + s0 & WORD
    s2 ^= s0
    s3 ^= s1
    stream[:] = s0 ^ s3, s1 ^ s2, s2 ^ (s1 << 17 & WORD), rotate(s3, 45)
    return word


def rotate(word: int, bits: int) -> int:
    """Rotate a 64-bit word to the left."""
    return (word << bits | word >> (64 - bits)) & WORD
