"""What the reward is worth elsewhere: learned in one world, used in another.

The rule and the predictions below were written down before any number was computed.

Learned is in five mazes whose right answer is known: the demonstration is a shortest path, hence
optimal for a reward of -1 a step. A learned reward is planned on exactly in each changed world, and
its greedy policy is judged by the true reward, see :mod:`replication.evidence.elsewhere`. Weights of
one-hot features go with the number of the cell; other features are computed anew, from the map and
for the move that is meant, whatever chance makes of it. The expert's copier has no reward: it does
in each cell what the expert does there, and where the expert never was the first move, up.

Rule
----
The reward of a method **transfers** to a kind of change if the value lost is small in every one of
the five tasks: the upper end of the 95 % interval of its mean over trials is at most `LIMIT`. A
method without chance is run once, and its value stands for both ends. The value lost is a share of
what an optimal policy has over random moves. From the start, two moves more than needed lose about
1 - 0.9^2 = 0.19 of it; so `LIMIT` means less than one move more on average.
"""

from __future__ import annotations

LIMIT = 0.1
"""The value lost up to which a reward transfers."""

TRIALS = 20
ROOT = 16
"""Number of trials of a method that learns by Q-learning, and their root seed."""

FEATURES = "features"
"""The name of the perceptron whose features mean the same in any maze."""

PREDICTED: dict[str, tuple[str, ...]] = {
    "unified-incorrect": (),
    "perceptron": (),
    "one-line": ("none",),
    "cloning": ("none",),
    "max-entropy": ("none",),
    FEATURES: ("none", "other starts", "slip 0.1", "slip 0.2", "slip 0.3", "another map"),
}
"""The changes to which we expect each method's reward to transfer; to no other.

Where the change is none, the reward is planned on exactly where it was learned. One-hot rewards that
stop as soon as Q-learning follows the expert need not have the expert's path as their optimum: we
expect that even this fails. The one-line reward has it by construction, but off the path it knows
only how to get back to it; each slip off the path then costs more than an optimal policy loses.
Maximum entropy matches the expert softly, and we expect its optimum to be the path, no more. Features
that mean the same anywhere should transfer, except that row and column were learned beside the
distance: they point to where the goal has been.
"""
