from __future__ import annotations

import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from replication import (
    DemoError,
    Demos,
    GymTask,
    Maze,
    TabularTask,
    from_minari,
    load_demos,
    make_demos,
    to_minari,
)
from replication.errors import UserError
from tests.demos.example import STORED

minari = pytest.importorskip("minari")
pytest.importorskip("h5py")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Keep datasets in a folder of the test."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    return tmp_path


def written(demos: Demos) -> Any:
    """Write demonstrations, and read the dataset from the disk."""
    to_minari(demos, "test/demos-v0")
    return minari.load_dataset("test/demos-v0")


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_the_round_trip_changes_nothing(path: Path) -> None:
    """Names, kinds, states, actions, task, words and environment come back, in the same order."""
    before = load_demos(path)
    dataset = written(before)
    assert from_minari(dataset) == before
    assert from_minari("test/demos-v0", before.environment) == before


def test_gymnasium_comes_back_from_its_name() -> None:
    """A dataset makes its environment again, with options and the names of actions."""
    env = gymnasium.make("FrozenLake-v1", is_slippery=False)
    task = GymTask(env, actions=("left", "down", "right", "up"))
    before = make_demos(task, {"correct": [[1, 1, 2, 1, 2, 2]], "hole": [[2, 1]], "idle": [[0]]})
    dataset = written(before)
    ended = [bool(episode.terminations[-1]) for episode in dataset.iterate_episodes()]
    assert ended == [True, True, False]
    after = from_minari(dataset)
    assert (after.correct, after.incorrect) == (before.correct, before.incorrect)
    assert after.environment.describe() == task.describe()


def test_a_task_of_ones_own_must_be_given() -> None:
    """What only a program can make is asked for; random moves are kept as they came."""
    task = TabularTask(np.array([[[0.5, 0.5]], [[0.0, 1.0]]]), terminal=[1])
    before = make_demos(task, {"correct": [([0, 0, 0, 1], [0, 0, 0])]})
    dataset = written(before)
    assert from_minari(dataset, task).correct == before.correct
    with pytest.raises(UserError, match="give `environment`"):
        from_minari(dataset)


def test_others_can_read_it(small_demos: Demos) -> None:
    """Spaces are discrete, rewards 0, and success, kind and name stand with each episode."""
    dataset = written(small_demos)
    assert dataset.observation_space == gymnasium.spaces.Discrete(42)
    assert dataset.action_space == gymnasium.spaces.Discrete(4)
    all_demos = small_demos.correct + small_demos.incorrect
    assert dataset.total_episodes == len(all_demos)
    for episode, demo in zip(dataset.iterate_episodes(), all_demos, strict=True):
        assert episode.observations.tolist() == demo.states.tolist()
        assert episode.actions.tolist() == demo.actions.tolist()
        assert not episode.rewards.any()
        at_goal = demo.states[-1] == small_demos.environment.goal  # type: ignore[attr-defined]
        assert episode.terminations.tolist() == [False] * (len(demo.actions) - 1) + [at_goal]
        assert (episode.terminations | episode.truncations).nonzero()[0] == len(demo.actions) - 1
    for facts, demo in zip(dataset.storage.get_episode_metadata(range(3)), all_demos, strict=False):
        assert bool(facts["success"]) == (demo.kind == "correct")
        assert facts["kind"] == demo.kind


def foreign(facts: list[dict[str, Any]] | None = None, n_states: int = 6) -> Any:
    """Write a dataset as somebody else would: a way to the goal, and one that stops before."""
    from minari.data_collector import EpisodeBuffer

    episodes = [
        EpisodeBuffer(
            observations=np.arange(length + 1),
            actions=np.full(length, 2),
            rewards=[1.0] * length,
            terminations=[False] * (length - 1) + [length == 2],
            truncations=[False] * (length - 1) + [length < 2],
        )
        for length in (1, 2)
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # nobody is named as its author
        dataset = minari.create_dataset_from_buffers(
            "foreign-v0",
            episodes,
            observation_space=gymnasium.spaces.Discrete(n_states),
            action_space=gymnasium.spaces.Discrete(4),
        )
    if facts:
        dataset.storage.update_episode_metadata(facts)
    return dataset


CORRIDOR = Maze(("S.G", "..."))


def test_a_dataset_of_others_is_read() -> None:
    """What ended by itself is correct, if nothing else says so."""
    demos = from_minari(foreign(), CORRIDOR)
    assert [demo.states.tolist() for demo in demos.correct] == [[0, 1, 2]]
    assert [(demo.kind, demo.states.tolist()) for demo in demos.incorrect] == [("failure", [0, 1])]
    assert demos.task == "minari"


def test_success_decides_where_there_is_no_kind() -> None:
    """Metadata count more than how an episode ended."""
    demos = from_minari(foreign([{"success": False}, {"success": True}]), CORRIDOR, task="mine")
    assert [demo.kind for demo in demos.incorrect] == ["failure"]
    assert demos.task == "mine"


def test_what_does_not_fit_is_refused() -> None:
    """Another environment, or none, is one line."""
    dataset = foreign([{"success": True}, {"success": True}])
    with pytest.raises(DemoError, match="'episode 0' is correct, but ends at"):
        from_minari(dataset, CORRIDOR)
    with pytest.raises(DemoError, match=r"observations are Discrete\(6\); .* has 3"):
        from_minari(dataset, Maze(("S.G",)))
    with pytest.raises(DemoError, match="starts at"):
        from_minari(dataset, Maze(("..G", "S..")))
    with pytest.raises(UserError, match="give `environment`"):
        from_minari(dataset)


def test_names_that_minari_refuses_are_one_line(small_demos: Demos, folder: Path) -> None:
    """A bad name, one that is taken, and a dataset that is not there."""
    to_minari(small_demos, "test/taken-v0")
    for call in (
        lambda: to_minari(small_demos, "no good"),
        lambda: to_minari(small_demos, "test/taken-v0"),
        lambda: from_minari("test/missing-v0"),
        lambda: from_minari("no good"),
    ):
        with pytest.raises(UserError, match=r"^dataset '.*': .+") as caught:
            call()
        assert "\n" not in str(caught.value)
    assert sorted(path.name for path in (folder / "test").iterdir() if path.is_dir()) == [
        "taken-v0"
    ]


def test_half_a_dataset_is_not_kept(
    small_demos: Demos, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the kinds of mistakes cannot be written, no dataset is left without them."""

    def fail(*_: Any) -> None:
        raise OSError("no space left")

    storage = "minari.dataset._storages.hdf5_storage.HDF5Storage"
    monkeypatch.setattr(f"{storage}.update_episode_metadata", fail)
    with pytest.raises(UserError, match="no space left"):
        to_minari(small_demos, "test/demos-v0")
    assert not minari.list_local_datasets()


def test_without_minari_one_line_says_how_to_install_it() -> None:
    """The package works without the extra, and names it where it is needed."""
    code = (
        "import sys; sys.modules['minari'] = None\n"
        "import replication\n"
        "try: replication.from_minari('x')\n"
        "except replication.DemoError: raise\n"
        "except ValueError as error: print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("pip install 'unified-irl-replication[minari]'\n")
    assert done.stdout.count("\n") == 1
