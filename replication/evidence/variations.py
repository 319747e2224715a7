"""The conditions behind the specifications: parameters, mazes and demonstrations that vary."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from replication.demos.files import load_demos
from replication.demos.maze_expert import Expert, demonstrate
from replication.demos.model import Demo, Demos
from replication.demos.soccer_expert import SoccerExpert, demonstrate_soccer
from replication.envs.maze import Maze, as_maze
from replication.envs.soccer.field import SoccerField
from replication.evidence.experiments import (
    EXPERIMENTS,
    NONE,
    Key,
    conditions_of,
    rule_conditions,
)
from replication.evidence.specifications import RANDOM, Ablations, Specification, default_of
from replication.irl import READINGS
from replication.irl.expectations import visited
from replication.paper.register import Value, load_choices
from replication.trials.condition import Condition

OBSTACLES = 30
MOVES = 33
"""Obstacle cells of a random maze, and the length of its shortest path."""

Ablation = tuple[str, str, str]
"""Method, reading of Eq. 9, and the name of the choices that are changed."""


def maze_conditions(specification: Specification, cap: int) -> dict[Key, Condition]:
    """Return the conditions of all methods in a maze, under the reading of Eq. 9 it chooses."""
    choices = dict(specification.choices)
    world = str(choices.pop("MAP", "open"))
    expert: dict[str, Any] = {}
    if choices.get("DEMO-SHAPE") == RANDOM:
        del choices["DEMO-SHAPE"]
        expert["path"] = "random-1"
    for id in ("DEMO-SHAPE", "DEMO-PATH", "DETOUR-WIDTH"):
        if id in choices:
            expert[_name(id)] = choices.pop(id)
    demos = maze_demos(world, Expert(**expert))
    return _chosen_reading(demos, {"max_iterations": cap}, choices, "open-maze")


def soccer_conditions(specification: Specification, cap: int) -> dict[Key, Condition]:
    """Return the conditions of both methods in robot soccer, in a new world if that changes."""
    choices = dict(specification.choices)
    experiment = EXPERIMENTS["soccer"]
    demos = load_demos(experiment.demos)
    assert isinstance(demos.environment, SoccerField)
    if "SOCCER-EPISODES" in choices:
        choices["EPISODES"] = choices.pop("SOCCER-EPISODES")
    world: dict[str, Any] = {}
    for id in list(choices):
        if load_choices()[id].field.startswith("SoccerParams."):
            world[_name(id)] = choices.pop(id)
    leave = choices.pop("SOCCER-INCORRECT", None)
    if world or leave:
        field = SoccerField(replace(demos.environment.params, **world))
        params = SoccerExpert(leave=str(leave)) if leave else SoccerExpert()
        demos = demonstrate_soccer(demos.task, field, params=params)
    base = {**experiment.choices, "max_iterations": cap}
    return _chosen_reading(demos, base, choices, "soccer")


def _chosen_reading(
    demos: Demos, base: Mapping[str, Any], choices: Mapping[str, Value], experiment: str
) -> dict[Key, Condition]:
    """Return the conditions of an experiment's methods under the reading and the set chosen."""
    values = {**base, **{_name(id): value for id, value in choices.items()}}
    reading = str(values.pop("f_index", default_of("F-INDEX")))
    design = EXPERIMENTS[experiment]
    chosen = str(values.pop("incorrect", design.sets[0]))
    conditions = conditions_of(demos, values, design.methods, [chosen])
    return {
        key: condition
        for key, condition in conditions.items()
        if condition.rule.under(reading) == key[1]
    }


def _name(id: str) -> str:
    """Return the name of the parameter that holds a choice."""
    return load_choices()[id].field.split(".")[1]


# --- mazes and demonstrations that are not stored ------------------------------------------------


@cache
def maze_demos(world: str, expert: Expert) -> Demos:
    """Return the demonstrations of a maze: "open", "obstacles" or "random-k"."""
    task, maze = _world(world)
    return demonstrate(task, maze, params=expert)


@cache
def _world(world: str) -> tuple[str, Maze]:
    """Return the name of a maze's task, and the maze."""
    stored = {"open": "open-maze", "obstacles": "obstacle-maze"}
    if world in stored:
        return stored[world], as_maze(load_demos(EXPERIMENTS[stored[world]].demos).environment)
    task = f"{world}-maze"
    template = load_demos(EXPERIMENTS["open-maze"].demos)
    shapes = load_choices()["DEMO-SHAPE"]
    experts = [Expert(leg=int(leg)) for leg in (shapes.default, *shapes.alternatives)]
    experts.append(Expert(path="random-1"))
    seed = np.random.SeedSequence(int(world.removeprefix("random-")))
    for maze in random_mazes(as_maze(template.environment), seed=seed):
        kinds = (demonstrate(task, maze, params=expert).kinds for expert in experts)
        if all(set(shown) == set(template.kinds) for shown in kinds):
            return task, maze
    raise AssertionError("random_mazes never ends")


def random_mazes(
    template: Maze, *, obstacles: int = OBSTACLES, moves: int = MOVES, seed: np.random.SeedSequence
) -> Iterator[Maze]:
    """Yield random mazes whose shortest path has the given number of moves, without end.

    Parameters
    ----------
    template
        Gives the size, the start and the goal; its obstacles are not kept.
    obstacles
        Number of obstacle cells, drawn without replacement from all others.
    moves
        Length of the shortest path.
    seed
        Of the draws.
    """
    rng = np.random.default_rng(seed)
    rows, columns = template.shape
    free = [cell for cell in range(rows * columns) if cell not in (template.start, template.goal)]
    while True:
        cells = np.full(rows * columns, ".")
        cells[rng.choice(free, size=obstacles, replace=False)] = "#"
        cells[[template.start, template.goal]] = "S", "G"
        try:
            maze = Maze(tuple("".join(row) for row in cells.reshape(rows, columns)))
        except ValueError:  # the goal cannot be reached
            continue
        if maze.distances()[maze.start] == moves:
            yield maze


def ablation_conditions(ablations: Ablations, cap: int) -> dict[Ablation, Condition]:
    """Return the ablations of the trace, the default first, and the readings of AdaBoost-IRL."""
    demos = load_demos(EXPERIMENTS["open-maze"].demos)
    rules = rule_conditions(demos, {"max_iterations": cap})
    return trace_conditions(ablations, cap) | {
        (condition.method, "", f"ADABOOST-RULE={rule}"): condition
        for rule, condition in rules.items()
    }


def trace_conditions(ablations: Ablations, cap: int) -> dict[Ablation, Condition]:
    """Return the default and the ablations of the trace.

    They are those of the unified method without and with incorrect demonstrations, under the
    readings of Eq. 9. While the trace stays as it is, the readings differ in marked pairs alone.
    """
    conditions = {}
    for changed in ({}, *ablations.traces):
        choices = tuple(changed.items())
        name = Specification("ablation", choices).name
        for reading in READINGS:
            specification = Specification("ablation", (*choices, ("F-INDEX", reading)))
            for (method, used, _), condition in maze_conditions(specification, cap).items():
                if used:
                    conditions[method, used, name] = condition
    return conditions


def numbered_conditions(ablations: Ablations, cap: int) -> dict[tuple[int, str], Condition]:
    """Return conditions with ever more incorrect demonstrations, from none to all pairs.

    Keys are the number of demonstrations and the reading of Eq. 9.
    """
    demos = maze_demos("open", Expert())
    every = _each_wrong_pair(demos, np.random.SeedSequence(ablations.seed))
    conditions: dict[tuple[int, str], Condition] = {}
    for number in ablations.numbers:
        n = len(every) if number == "all" else number
        shown = replace(demos, incorrect=tuple(every[:n]))
        method = "unified-incorrect" if n else "unified"
        own = conditions_of(shown, {"max_iterations": cap}, [method], ["all"] if n else [NONE])
        conditions |= {(n, reading): condition for (_, reading, _), condition in own.items()}
    return conditions


def _each_wrong_pair(demos: Demos, seed: np.random.SeedSequence) -> list[Demo]:
    """Return a demonstration of each pair that the expert does not take, in random order.

    It is a shortest path from the start to the pair's state, and then the pair's action.
    """
    maze = as_maze(demos.environment)
    right = visited(demos.correct, shape=(maze.n_states, maze.n_actions))
    ways: dict[int, list[int]] = {maze.start: []}
    waiting = [maze.start]
    for state in waiting:  # it grows meanwhile
        for action, there in enumerate(maze.next_state[state].tolist()):
            if there not in ways and state != maze.goal:
                ways[there] = [*ways[state], action]
                waiting.append(there)
    pairs = [
        (state, action)
        for state in ways
        if state != maze.goal
        for action in range(maze.n_actions)
        if not right[state, action]
    ]
    order = np.random.default_rng(seed).permutation(len(pairs))
    demos_of_pairs = []
    for number, (state, action) in enumerate(pairs[at] for at in order.tolist()):
        actions = [*ways[state], action]
        demo = Demo(f"pair-{number}", "pair", maze.replay(actions), np.array(actions))
        demos_of_pairs.append(demo)
    return demos_of_pairs
