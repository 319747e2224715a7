from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import combinations, islice
from typing import Any

import numpy as np
import pytest

from replication import Demos, Maze, load_demos
from replication.envs.maze import as_maze
from replication.evidence.claims import ClaimError, load_claims
from replication.evidence.experiments import EXPERIMENTS
from replication.evidence.specifications import (
    MAPS,
    MOVES,
    OBSTACLES,
    RANDOM,
    Factorial,
    Specification,
    default_of,
    factorial_specifications,
    load_specifications,
    maze_conditions,
    numbered_conditions,
    parse_specifications,
    random_mazes,
    single_specifications,
    soccer_conditions,
    trace_conditions,
)
from replication.files import PROJECT, resolve
from replication.irl import READINGS
from replication.paper.register import ChoiceError, load_choices
from replication.trials.condition import Condition
from replication.trials.measures import marked_pairs

TEXT = (PROJECT / "replication" / "evidence" / "specifications.toml").read_text(encoding="utf-8")
PLAN = load_specifications()
CAP = PLAN.iteration_cap
SINGLE = single_specifications(PLAN.mazes.single.choices)
SOCCER = single_specifications(PLAN.soccer.single.choices)
FACTORIAL = factorial_specifications(PLAN.mazes.factorial)
SLOW = {"random-2", "random-3"}
"""Mazes that are left out here: to find a random one takes seconds."""


def expert_choices(one: Specification) -> set[str]:
    """Return those choices of a specification that change demonstrations, not parameters."""
    return {id for id, _ in one.choices} & {"MAP", "DEMO-SHAPE", "DEMO-PATH", "DETOUR-WIDTH"}


# --- the declared sets -----------------------------------------------------------------------


def test_enough_is_declared() -> None:
    """At least 40 specifications change one choice, at least 200 ten at once, all distinct."""
    assert len(SINGLE) >= 40
    assert len(FACTORIAL) >= 200
    assert len({len(one.choices) for one in FACTORIAL}) == 1
    for specifications in (SINGLE, FACTORIAL, SOCCER):
        assert len({one.choices for one in specifications}) == len(specifications)
        assert len({one.name for one in specifications}) == len(specifications)


def test_root_seed_is_the_judging_one() -> None:
    """The same trials are behind the verdicts and the defaults of the specifications."""
    assert load_claims().judging.root_seed == PLAN.root_seed
    assert PLAN.mazes.single.trials >= load_claims().judging.fewest


def test_every_claim_with_an_effect_is_evaluated() -> None:
    """All are but the published numbers and the maze with obstacles, which is a value of MAP."""
    evaluated = {*PLAN.mazes.claims, *PLAN.soccer.claims}
    due = {
        one.id
        for one in load_claims().claim
        if one.direction != "inside" and one.task != "obstacle-maze"
    }
    assert evaluated == due


@pytest.mark.parametrize("choices", [PLAN.mazes.single.choices, PLAN.soccer.single.choices])
def test_no_single_specification_is_the_default(choices: dict[str, Any]) -> None:
    """The default is there once, under its name; no value of a choice repeats it."""
    first, *others = single_specifications(choices)
    assert (first.choices, first.name) == ((), "default")
    assert len(others) == sum(map(len, choices.values()))
    for one in others:
        ((id, value),) = one.choices
        assert value != default_of(id)


def test_every_open_choice_of_the_mazes_is_varied() -> None:
    """What the paper leaves open and a parameter holds is in the list, but for soccer's own."""
    left_out = {
        id
        for id, one in load_choices().items()
        if one.field.split(".")[0] in ("Learner", "Loop", "Update", "Expert", "Demonstrations")
        and not one.open.startswith("stated:")
        and id not in PLAN.mazes.single.choices
    }
    assert left_out <= {"HORIZON", "ITERATION-CAP", "GOAL-VALUE"}


# --- the factorial ---------------------------------------------------------------------------


def test_factors_are_balanced() -> None:
    """Each value of a choice stands in equally many specifications."""
    for id, values in PLAN.mazes.factorial.choices.items():
        counts = Counter(dict(one.choices)[id] for one in FACTORIAL)
        assert counts == dict.fromkeys(values, PLAN.mazes.factorial.size // len(values))


def test_factors_are_nearly_uncorrelated() -> None:
    """No value of one choice goes with a value of another more than by chance in 240 draws."""
    table = [dict(one.choices) for one in FACTORIAL]
    columns = {
        (id, value): np.array([row[id] == value for row in table], dtype=float)
        for id, values in PLAN.mazes.factorial.choices.items()
        for value in values
    }
    found = [
        abs(np.corrcoef(columns[one], columns[other])[0, 1])
        for one, other in combinations(columns, 2)
        if one[0] != other[0]
    ]
    assert max(found) < 4 / 240**0.5  # four standard errors
    assert np.mean(found) < 1 / 240**0.5


def test_every_default_stands_in_the_factorial() -> None:
    """The defaults are among the crossed values, so that levels can be compared with them."""
    for id, values in PLAN.mazes.factorial.choices.items():
        assert default_of(id) in values


def test_factorial_depends_on_its_seed_alone() -> None:
    """The same seed gives the same specifications, another one others."""
    plan = PLAN.mazes.factorial
    assert factorial_specifications(plan) == FACTORIAL
    other = Factorial(**{**plan.model_dump(), "seed": plan.seed + 1})
    assert factorial_specifications(other) != FACTORIAL


# --- what a specification changes ------------------------------------------------------------


@pytest.fixture(scope="module")
def default() -> dict[tuple[str, str], Condition]:
    """Return the conditions of the default specification."""
    return maze_conditions(SINGLE[0], CAP)


def test_default_is_the_experiment_of_the_open_maze(
    default: dict[tuple[str, str], Condition],
) -> None:
    """Under the default the conditions are those of Table I, but for the iteration cap."""
    table = EXPERIMENTS["open-maze"].conditions()
    assert set(default) == {key for key in table if key[1] in ("", "printed")}
    for key, condition in default.items():
        assert condition.demos.correct == table[key].demos.correct
        assert condition.demos.incorrect == table[key].demos.incorrect
        assert condition.params.differences() == {"ITERATION-CAP": CAP}


@pytest.mark.parametrize(
    "one", [s for s in SINGLE[1:] if s.choices[0][1] not in SLOW], ids=lambda s: s.name
)
def test_single_specification_changes_one_choice(
    one: Specification, default: dict[tuple[str, str], Condition]
) -> None:
    """Either one parameter or the demonstrations differ from the default, and nothing else."""
    ((id, value),) = one.choices
    conditions = maze_conditions(one, CAP)
    reading = value if id == "F-INDEX" else "printed"
    assert set(conditions) == {(method, f and reading) for method, f in default}
    for (method, f), condition in conditions.items():
        other = default[method, f and "printed"]
        changed = condition.params.differences()
        if expert_choices(one):
            assert changed == {"ITERATION-CAP": CAP}
            assert condition.demos != other.demos
            same_maze = (
                as_maze(condition.demos.environment).next_state.tolist()
                == as_maze(other.demos.environment).next_state.tolist()
            )
            assert same_maze == (id != "MAP")
            if id == "DETOUR-WIDTH":
                assert condition.demos.correct == other.demos.correct
            elif id != "MAP":
                assert len(condition.demos.correct[0].actions) == 31
                assert condition.demos.correct != other.demos.correct
        else:
            due = {id: value} if (id, f) != ("F-INDEX", "") else {}
            assert changed == {"ITERATION-CAP": CAP, **due}
            assert condition.demos == other.demos


@pytest.mark.parametrize("one", SOCCER, ids=lambda s: s.name)
def test_soccer_specification_changes_one_choice(one: Specification) -> None:
    """In robot soccer, too: a parameter, the world, or where the expert errs."""
    task = EXPERIMENTS["soccer"].conditions()
    base = next(iter(task.values()))
    usual = {**base.params.differences(), "ITERATION-CAP": CAP}
    conditions = soccer_conditions(one, CAP)
    choices = dict(one.choices)
    reading = choices.pop("F-INDEX", "printed")
    assert set(conditions) == {(method, reading) for method, f in task if f == "printed"}
    if "SOCCER-EPISODES" in choices:
        choices["EPISODES"] = choices.pop("SOCCER-EPISODES")
    world = {
        id: choices.pop(id)
        for id in list(choices)
        if load_choices()[id].field.startswith("SoccerP")
    }
    elsewhere = choices.pop("SOCCER-INCORRECT", None)
    for condition in conditions.values():
        assert (condition.demos.incorrect != base.demos.incorrect) == bool(elsewhere or world)
        due = {**usual, **choices, **({"F-INDEX": "updated"} if reading == "updated" else {})}
        assert condition.params.differences() == due
        theirs, ours = base.demos.environment, condition.demos.environment
        assert (theirs.params != ours.params) == bool(world)  # type: ignore[attr-defined]
        for id, value in world.items():
            name = load_choices()[id].field.split(".")[1]
            assert getattr(ours.params, name) == value  # type: ignore[attr-defined]
            alike = replace(ours.params, **{name: getattr(theirs.params, name)})  # type: ignore[attr-defined]
            assert alike == theirs.params  # type: ignore[attr-defined]


def test_factorial_specification_sets_all_its_choices() -> None:
    """Every choice of a specification is found in its conditions, the cap in all of them."""
    few = [one for one in FACTORIAL if dict(one.choices)["MAP"] in ("open", "obstacles")][:12]
    assert {dict(one.choices)["DEMO-SHAPE"] for one in few} > {RANDOM}
    for one in few:
        choices = dict(one.choices)
        conditions = maze_conditions(one, CAP)
        reading = choices.pop("F-INDEX")
        moves = {"open": 31, "obstacles": 33}[str(choices.pop("MAP"))]
        del choices["DEMO-SHAPE"]
        assert {f for _, f in conditions} == {"", reading}
        for (_, f), condition in conditions.items():
            assert len(condition.demos.correct[0].actions) == moves
            values = condition.params.values()
            assert values["max_iterations"] == CAP
            assert values["f_index"] == (reading if f else "printed")
            for id, value in choices.items():
                assert values[load_choices()[id].field.split(".")[1]] == value


# --- what is refused -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"FASTER"', '"FASTR"', "unknown claim 'FASTR' (did you mean 'FASTER'?)"),
        ('"ZERO-SOCCER"', '"ZERO"', "unknown claim 'ZERO'"),
        ('TIES = ["first"]', 'TEIS = ["first"]', "mazes.single: there is no choice 'TEIS'"),
        ('TIES = ["first"]', 'TIES = ["last"]', "mazes.single: Learner.ties = 'last' is not"),
        ('TIES = ["first"]', 'BUMP = ["x"]', "mazes.single: BUMP has no parameter"),
        ('"random-3"]', '"random-9"]', "mazes.single: MAP = 'random-9' is not accepted: use open"),
        ('16, "random"]', '16, "any"]', "mazes.factorial: Expert.leg = 'any' is not"),
        ('["bootstrap"]', '["one"]', "soccer.single: Learner.goal_value = 'one' is not"),
        ("SOCCER-EPISODES = [10]", 'SOCCER-EPISODES = ["x"]', "soccer.single: Learner.episodes"),
        ("traces = [{ALPHA = 0.0", "traces = [{ALPHA = 0.7", "ablations.traces[0]: Update.alpha"),
        (
            "size = 240",
            "size = 241",
            "mazes.factorial: 5 values of MAP cannot be balanced over 241",
        ),
        ("size = 240", "", "mazes.factorial.size: Field required"),
        ("trials = 30", "trails = 30", "mazes.single.trials: Field required"),
        ("seed = 7", "seed = 7\nmore = 1", "ablations.more: Extra inputs are not permitted"),
        ("numbers = [0", 'numbers = ["some"', "ablations.numbers.0"),
        ("[mazes]", "[mazes", "is not TOML: "),
        ('"FASTER"', '"SAVES-SOCCER"', "mazes.claims: SAVES-SOCCER is about the task 'soccer'"),
        ('"FASTER"', '"ZERO-OBSTACLES"', "mazes.claims: ZERO-OBSTACLES is about the task"),
        ('"SAVES-SOCCER"', '"SAVES-OPEN"', "soccer.claims: SAVES-OPEN is about the task"),
        ('"FASTER"', '"MEAN-UNIFIED-OPEN"', "mazes.claims: MEAN-UNIFIED-OPEN is about a publ"),
        ('W-NORM = ["unit"]', "SOCCER-ARC = [180]", "mazes.single: SOCCER-ARC changes nothing"),
        ('W-NORM = ["unit"]', "SOCCER-EPISODES = [10]", "mazes.single: SOCCER-EPISODES changes"),
        ("SOCCER-ARC = [180]", "DETOUR-WIDTH = [8]", "soccer.single: DETOUR-WIDTH changes nothing"),
        ("SOCCER-ARC = [180]", 'MAP = ["open"]', "soccer.single: MAP changes nothing in soccer"),
        ("trials = 30", "trials = 0", "mazes.single.trials: Input should be greater than or"),
        ("trials = 10", "trials = 1", "mazes.factorial.trials: Input should be greater than or"),
        ("size = 240", "size = 0", "mazes.factorial.size: Input should be greater than or"),
        ("seed = 240", "seed = -1", "mazes.factorial.seed: Input should be greater than or"),
        ("root_seed = 2026", "root_seed = -1", "root_seed: Input should be greater than or"),
        ("iteration_cap = 200", "iteration_cap = 0", "iteration_cap: Input should be greater"),
        ("numbers = [0", "numbers = [-1", "ablations.numbers.0"),
        ("numbers = [0, ", "numbers = [", "ablations.numbers: add 0"),
    ],
)
def test_bad_entry_is_one_line(old: str, new: str, said: str) -> None:
    """What is unknown, missing, not accepted or not balanced is one line that names the place."""
    assert old in TEXT
    with pytest.raises((ChoiceError, ClaimError)) as caught:
        parse_specifications(TEXT.replace(old, new, 1))
    assert str(caught.value).startswith("specifications.toml")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


# --- random mazes ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def template() -> Maze:
    """Return the open maze."""
    return as_maze(load_demos(resolve(EXPERIMENTS["open-maze"].demos)).environment)


def test_random_mazes_are_as_declared(template: Maze) -> None:
    """They have the template's size, start and goal, 30 obstacles and a path of 33 moves."""
    found = list(islice(random_mazes(template, seed=np.random.SeedSequence(5)), 2))
    for maze in found:
        assert (maze.shape, maze.start, maze.goal) == (
            template.shape,
            template.start,
            template.goal,
        )
        assert (~maze.free).sum() == OBSTACLES == 30
        assert maze.distances()[maze.start] == MOVES == 33
    assert found[0].next_state.tolist() != found[1].next_state.tolist()


def test_random_mazes_depend_on_their_seed_alone(template: Maze) -> None:
    """The same seed gives the same maze, another one another."""
    one, same, other = (
        next(random_mazes(template, moves=31, obstacles=12, seed=np.random.SeedSequence(seed)))
        for seed in (5, 5, 6)
    )
    assert one.next_state.tolist() == same.next_state.tolist()
    assert one.next_state.tolist() != other.next_state.tolist()
    assert (~one.free).sum() == 12
    assert one.distances()[one.start] == 31


def test_random_map_lets_the_expert_show_everything(template: Maze) -> None:
    """In a declared random maze each kind of mistake can be driven, and the task has its name."""
    one = Specification("single", (("MAP", "random-1"), ("INCORRECT-KINDS", "all")))
    demos = maze_conditions(one, CAP)["unified-incorrect", "printed"].selected
    stored = load_demos(resolve(EXPERIMENTS["open-maze"].demos))
    assert set(demos.kinds) == set(stored.kinds)
    assert (demos.task, len(demos.correct[0].actions)) == ("random-1-maze", MOVES)
    assert (~as_maze(demos.environment).free).sum() == OBSTACLES
    assert (as_maze(demos.environment).start, as_maze(demos.environment).goal) == (
        template.start,
        template.goal,
    )
    assert {map.removeprefix("random-") for map in MAPS[2:]} == {"1", "2", "3"}


# --- ablations -------------------------------------------------------------------------------


def test_ablations_of_the_trace() -> None:
    """The default and two ablations, each without and with incorrect ones, under both readings."""
    found = trace_conditions(PLAN.ablations, CAP)
    assert len(found) == 12
    for name, condition in found.items():
        label, reading, changed = name.rsplit(", ", 2)
        update = condition.params.update
        assert ("with incorrect" in label) == (condition.method == "unified-incorrect")
        assert ("updated" in reading) == (update.f_index == "updated")
        due = {
            "default": (default_of("ALPHA"), default_of("F-START")),
            "ALPHA=0.0 F-START=1.0": (0.0, 1.0),
            "ALPHA=0.0": (0.0, default_of("F-START")),
        }[changed]
        assert (update.alpha, update.f_start) == due
        assert condition.params.loop.max_iterations == CAP
        assert condition.demos.task == "open-maze"


@pytest.fixture(scope="module")
def numbered() -> dict[tuple[int, str], Condition]:
    """Return the conditions with ever more incorrect demonstrations."""
    return numbered_conditions(PLAN.ablations, CAP)


def test_more_demonstrations_mark_more_pairs(numbered: dict[tuple[int, str], Condition]) -> None:
    """Each set holds the one before, so that the marked pairs grow from none to all."""
    before: tuple[Any, ...] = ()
    marked = np.zeros((400, 4), dtype=bool)
    for number in dict.fromkeys(number for number, _ in numbered):
        shown = {numbered[number, f].selected for f in READINGS}
        (selected,) = {one.incorrect for one in shown}
        assert len(selected) == number
        assert selected[: len(before)] == before
        now = marked_pairs(numbered[number, "printed"].selected)
        assert (now & marked == marked).all()
        assert now.sum() > marked.sum() or number == 0
        before, marked = selected, now
    assert number > max(n for n in PLAN.ablations.numbers if n != "all")


def test_all_demonstrations_mark_all_pairs(numbered: dict[tuple[int, str], Condition]) -> None:
    """The largest set marks each pair of a state that is not the goal that the expert lacks."""
    largest = max(number for number, _ in numbered)
    demos = numbered[largest, "printed"].selected
    maze, (correct,) = as_maze(demos.environment), demos.correct
    due = np.repeat(maze.free[:, None], 4, axis=1)
    due[maze.goal] = False
    due[correct.states[:-1], correct.actions] = False
    assert largest == due.sum()
    assert (marked_pairs(demos) == due).all()


def test_numbered_demonstrations_lead_to_their_pair(
    numbered: dict[tuple[int, str], Condition],
) -> None:
    """Each is a shortest way to a state and then one wrong action; no two show the same pair."""
    demos = numbered[max(number for number, _ in numbered), "printed"].selected
    maze = as_maze(demos.environment)
    back = distances_from_start(demos)
    pairs = set()
    for demo in demos.incorrect:
        state = int(demo.states[-2])
        assert len(demo.actions) == back[state] + 1
        assert maze.next_state[state, demo.actions[-1]] == demo.states[-1]
        pairs.add((state, int(demo.actions[-1])))
    assert len(pairs) == len(demos.incorrect)


def distances_from_start(demos: Demos) -> dict[int, int]:
    """Return the number of moves from the start to every state, not through the goal."""
    maze = as_maze(demos.environment)
    found, layer, moves = {maze.start: 0}, {maze.start}, 0
    while layer:
        moves += 1
        layer = {
            int(there) for state in layer - {maze.goal} for there in maze.next_state[state]
        } - set(found)
        found |= dict.fromkeys(layer, moves)
    return found


def test_numbered_settings_differ_in_demonstrations_alone(
    numbered: dict[tuple[int, str], Condition],
) -> None:
    """Without incorrect demonstrations it is the method that uses none; the cap reaches all."""
    for (number, f), condition in numbered.items():
        assert condition.method == ("unified-incorrect" if number else "unified")
        assert condition.params.update.f_index == f
        changed = set(condition.params.differences()) - {"F-INDEX"}
        assert changed == {"ITERATION-CAP", "INCORRECT-KINDS"}
        assert condition.params.loop.max_iterations == CAP
        assert condition.demos.correct == numbered[0, "printed"].demos.correct
