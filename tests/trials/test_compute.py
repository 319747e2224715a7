from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

from replication import Demos
from replication.files import PROJECT
from replication.irl import METHODS, Trial
from replication.paper.params import Params
from replication.paper.register import load_choices
from replication.trials import compute
from replication.trials.compute import TRACED_TRIAL, trial_key
from replication.trials.condition import Condition

PACKAGE = PROJECT / "replication"
FEW = {"episodes": 60, "horizon": 40, "max_iterations": 20}


@pytest.fixture
def condition(small_demos: Demos) -> Condition:
    """Return a condition that uses incorrect demonstrations."""
    return Condition(small_demos, "unified-incorrect", Params.of(**FEW, incorrect="all"))


def other_value(id: str) -> Any:
    """Return a value of a choice that is accepted and not the default."""
    entry = load_choices()[id]
    if entry.range is None:
        return entry.alternatives[0]
    low, high = entry.range
    return type(entry.default)(low if entry.default != low else high)


PARAMETERS = {
    entry.field.split(".")[1]: entry.id for entry in load_choices().values() if entry.field
}


@pytest.mark.parametrize("name", sorted(set(Params().values()) - {"incorrect"}))
def test_every_parameter_gives_another_key(
    soccer_demos: Demos, small_demos: Demos, name: str
) -> None:
    """Each parameter of a trial is part of its key; in soccer, but for what only mazes have."""
    demos = small_demos if name in ("arithmetic", "solver") else soccer_demos
    default = Condition(demos, "unified-incorrect", Params.of(incorrect="all"))
    params = Params.of(incorrect="all", **{name: other_value(PARAMETERS[name])})
    assert params != default.params
    assert trial_key(replace(default, params=params), 1, 0) != trial_key(default, 1, 0)


def test_method_demos_and_seed_give_another_key(condition: Condition) -> None:
    """Whatever else determines a trial is part of its key, one by one."""
    demos = condition.demos
    twin = replace(demos.correct[0], name="twin")
    others = [
        *(replace(condition, method=name) for name in METHODS if name != condition.method),
        replace(condition, params=Params.of(**FEW, incorrect="hit")),
        replace(condition, demos=replace(demos, correct=(*demos.correct, twin))),
        replace(condition, demos=replace(demos, incorrect=demos.incorrect[1:])),
    ]
    keys = [trial_key(each, 1, 3) for each in (condition, *others)]
    keys += [trial_key(condition, 1, 4), trial_key(condition, 2, 3)]
    assert len(set(keys)) == len(keys)


def test_traced_trials_have_a_key_of_their_own(condition: Condition) -> None:
    """A trial with its snapshots is not one without; others never have any."""
    assert trial_key(condition, 1, TRACED_TRIAL) != trial_key(
        condition, 1, TRACED_TRIAL, traced=False
    )
    after = TRACED_TRIAL + 1
    assert trial_key(condition, 1, after) == trial_key(condition, 1, after, traced=False)


@pytest.mark.parametrize(
    ("owner", "name", "value"),
    [
        (compute, "source_hash", lambda *_: "other"),
        (numba, "__version__", "0"),
        (np, "__version__", "0"),
    ],
)
def test_code_and_versions_give_another_key(
    condition: Condition, monkeypatch: pytest.MonkeyPatch, owner: Any, name: str, value: Any
) -> None:
    """What computes a trial is part of its key: our code, numpy and numba."""
    before = trial_key(condition, 1, 0)
    monkeypatch.setattr(owner, name, value)
    assert trial_key(condition, 1, 0) != before


def test_nothing_else_gives_another_key(
    condition: Condition, monkeypatch: pytest.MonkeyPatch, tmp_path: Any
) -> None:
    """Neither prose, nor the task's name, nor the working folder or environment is in the key."""
    before = trial_key(condition, 1, 0)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("REPLICATION_SCHEDULER", "tcp://nowhere:1")
    described = replace(condition.demos, description="other words")
    assert trial_key(replace(condition, demos=described), 1, 0) == before
    unseen = replace(condition, method="unified")
    chosen = replace(unseen, params=Params.of(**FEW, incorrect="none"))
    assert trial_key(unseen, 1, 0) == trial_key(chosen, 1, 0)


def test_key_is_the_same_in_another_process(condition: Condition) -> None:
    """Keys are hex digits that depend on no object's identity or hash."""
    twin = Condition(replace(condition.demos), condition.method, Params.of(**FEW, incorrect="all"))
    assert trial_key(twin, 1, 0) == trial_key(condition, 1, 0)
    assert set(trial_key(condition, 1, 0)) <= set("0123456789abcdef")


# What of the package's code is in a key, for each task, by the modules that stand for it.
BOTH = [
    *("trials.compute", "trials.condition", "demos.model", "envs.environment"),
    *("irl.agent", "irl.expectations", "irl.loop"),
    *("learning", "learning.seeds", "learning.arguments", "learning.compiled"),
]
MAZE = [
    *("envs.maze", "learning.planning", "learning.qlearning", "learning.reference"),
    "trials.table_agent",
]
SOCCER = [
    *("envs.soccer", "envs.soccer.rules", "envs.soccer.world", "envs.soccer.compiled"),
    *("envs.soccer.field", "learning.soccer", "trials.soccer_agent"),
]
UPDATES = ["irl.unified", "irl.adaboost"]

# Edits a copy of the package and prints, for each edit, the keys of one trial of each kind.
KEYS = """
import ast, json, sys
from pathlib import Path
from replication import load_demos
from replication.paper.params import Params
from replication.source import source_hash
from replication.trials.compute import trial_key
from replication.trials.condition import Condition

package, edits, data = Path(sys.argv[1]), json.loads(sys.argv[2]), Path(sys.argv[3])
conditions = [
    Condition(load_demos(data / f"{name}.json"), method, Params())
    for name, method in (("open_maze", "unified"), ("soccer", "adaboost"))
]

def reworded(text):
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            node.exc.args = [ast.Constant("other words")]
        if isinstance(node, ast.Expr) and isinstance(getattr(node.value, "value", None), str):
            node.value.value = "Other words."
    return ast.unparse(tree)

def changed(text, how):
    return reworded(text) if how == "reword" else text + how

keys = {}
for name, (modules, how) in edits.items():
    before = {package / module: (package / module).read_bytes() for module in modules}
    for path, content in before.items():
        path.write_text(changed(content.decode(), how), encoding="utf-8")
    source_hash.cache_clear()
    keys[name] = [trial_key(condition, 1, 0) for condition in conditions]
    for path, content in before.items():
        path.write_bytes(content)
print(json.dumps(keys))
"""

Keys = dict[str, list[str]]


def module_file(name: str) -> str:
    """Return the file of a module, relative to the package's folder."""
    path = name.replace(".", "/")
    folder = (PACKAGE / path).is_dir()
    return f"{path}/__init__.py" if folder else f"{path}.py"


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Keys:
    """Keys of a trial in a maze (unified) and in soccer (AdaBoost-IRL), by edits of the code."""
    root = tmp_path_factory.mktemp("copy")
    package = Path(shutil.copytree(PACKAGE, root / "replication"))  # with what is compiled
    computing = {module_file(name) for name in BOTH + MAZE + SOCCER + UPDATES}
    others = {path.relative_to(package).as_posix() for path in package.rglob("*.py")} - computing
    code = "\n\ndef added():\n    return 1\n"
    edits = {
        "nothing": ([], ""),
        "other modules": (sorted(others), code),
        "words": (sorted(computing | others), "reword"),
        "comments": (sorted(computing | others), "\n# A comment.\n"),
        "method": (["irl/methods.py"], "\nMETHODS['new'] = METHODS['unified']\n"),
    } | {name: ([module_file(name)], code) for name in BOTH + MAZE + SOCCER + UPDATES}
    done = subprocess.run(
        [sys.executable, "-c", KEYS, str(package), json.dumps(edits), str(PROJECT / "data/demos")],
        env=os.environ | {"PYTHONPATH": str(root)},
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    keys: Keys = json.loads(done.stdout)
    return keys


@pytest.mark.parametrize("edit", ["other modules", "words", "comments", "method"])
def test_what_does_not_compute_changes_no_key(keys: Keys, edit: str) -> None:
    """Other modules' code, any docstring or error message, comments and a new method do not count.

    Among the other modules are those that read files, check, report, run notebooks and make pages.
    """
    assert keys[edit] == keys["nothing"]
    assert len(set(keys["nothing"])) == 2


@pytest.mark.parametrize("module", BOTH + MAZE + SOCCER + UPDATES)
def test_what_computes_changes_the_keys_of_its_trials(keys: Keys, module: str) -> None:
    """Code that only a maze, only soccer or only one method runs changes no other trial's key."""
    maze, soccer = (
        now != before for now, before in zip(keys[module], keys["nothing"], strict=True)
    )
    assert maze == (module not in (*SOCCER, "irl.adaboost"))
    assert soccer == (module not in (*MAZE, "irl.unified"))


def test_a_trial_comes_with_its_key_and_descends_from_its_child_of_the_root(
    condition: Condition,
) -> None:
    """Trial k is the condition's trial with child k of the root seed, under its key."""
    key, trial = compute.compute(condition, 2, 7)
    assert key == trial_key(condition, 7, 2)
    seed = np.random.SeedSequence(7).spawn(3)[2]
    assert bits(trial) == bits(condition.trial(seed=seed))


@pytest.mark.parametrize("traced", [True, False])
def test_only_the_traced_trial_keeps_snapshots(condition: Condition, traced: bool) -> None:
    """The declared trial keeps every iteration, if asked for; its result is the same without."""
    first, second = (compute.compute(condition, k, 7, traced=traced)[1] for k in (0, 1))
    assert (first.snapshots is not None) == traced
    assert second.snapshots is None
    _, other = compute.compute(condition, 0, 7, traced=not traced)
    assert bits(other) == bits(first)


def bits(trial: Trial) -> tuple[object, ...]:
    """Return all of a trial but its snapshots."""
    arrays: list[Any] = [trial.errors, trial.weights, trial.q]
    arrays += [trial.collisions, trial.values, trial.rewards, *sum(trial.episodes, ())]
    return trial.converged, trial.steps, *(array.tobytes() for array in arrays)
