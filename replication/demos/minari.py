"""Demonstrations as Minari datasets, the format in which others share theirs.

Minari is the optional extra ``minari``. It keeps datasets on this machine: in the folder that the
environment variable MINARI_DATASETS_PATH names, or else in its own.
"""

from __future__ import annotations

import json
import warnings
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np

from replication.demos.checks import DemoError
from replication.demos.model import Demo, Demos
from replication.demos.schema import FORMAT, VERSION, read_fields
from replication.envs.environment import Environment
from replication.envs.tasks.base import is_over
from replication.errors import UserError, need, show
from replication.files import parse_json

if TYPE_CHECKING:
    from minari import MinariDataset

ABOUT = "replication"
"""Metadata of a dataset with the task, its description and its environment, as JSON text."""


def to_minari(demos: Demos, dataset_id: str) -> MinariDataset:
    """Write demonstrations as a Minari dataset, an episode each.

    An episode's metadata are ``success``, ``kind`` and ``name``. All rewards are 0: the expert's
    reward is what nobody knows.

    Parameters
    ----------
    demos
        What is written.
    dataset_id
        Minari's name of the dataset, such as "maze/mine-v0".

    Raises
    ------
    UserError
        If Minari is not installed, or refuses: the name is taken, for instance.
    """
    minari = _minari()
    from minari.data_collector import EpisodeBuffer

    environment = demos.environment
    all_demos = demos.correct + demos.incorrect
    episodes = []
    for number, demo in enumerate(all_demos):
        ended = np.zeros(len(demo.actions), dtype=bool)
        over = ended.copy()
        ended[-1] = bool(is_over(environment, demo.states, demo.actions))
        over[-1] = not ended[-1]
        episode = EpisodeBuffer(
            id=number,
            observations=demo.states,
            actions=demo.actions,
            rewards=[0.0] * len(demo.actions),
            terminations=ended.tolist(),
            truncations=over.tolist(),
        )
        episodes.append(episode)
    about = {
        "task": demos.task,
        "description": demos.description,
        "environment": environment.describe(),
    }
    spaces = {
        "observation_space": gymnasium.spaces.Discrete(environment.n_states),
        "action_space": gymnasium.spaces.Discrete(environment.n_actions),
    }
    words = demos.description or f"Demonstrations of {demos.task}; rewards are 0."
    dataset = None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that neither author nor code is named
            dataset = minari.create_dataset_from_buffers(
                dataset_id, episodes, description=words, **spaces
            )
        dataset.storage.update_metadata({ABOUT: json.dumps(about)})
        dataset.storage.update_episode_metadata(
            {"success": demo.kind == "correct", "kind": demo.kind, "name": demo.name}
            for demo in all_demos
        )
    except BaseException as error:
        if dataset is not None:  # half a dataset would be read without the kinds of mistakes
            minari.delete_dataset(dataset_id)
        if isinstance(error, ValueError | OSError | ImportError):
            raise UserError(f"dataset {show(dataset_id)}: {_line(error)}") from None
        raise
    return dataset


def from_minari(
    dataset: MinariDataset | str,
    environment: Environment | None = None,
    task: str | None = None,
) -> Demos:
    """Return the demonstrations of a Minari dataset.

    What ``kind`` says in an episode's metadata is its kind. Without it, an episode is correct if
    ``success`` is true, or if that is missing, too, and it ended by itself; else its kind is
    "failure".

    Parameters
    ----------
    dataset
        A dataset, or the name of one on this machine; nothing is downloaded.
    environment
        Where the demonstrations were made; may be left out if :func:`to_minari` wrote them.
    task
        Name of the task; as it was written, or "minari", by default.

    Raises
    ------
    UserError
        If Minari is not installed, or there is no such dataset.
    DemoError
        If an episode is not one of the environment.
    """
    minari = _minari()
    try:
        data: Any = minari.load_dataset(dataset) if isinstance(dataset, str) else dataset
    except (ValueError, OSError, ImportError) as error:
        raise UserError(f"dataset {show(dataset)}: {_line(error)}") from None
    about = _about(data)
    environment = environment or _environment(about)
    for space, number, what in (
        (data.observation_space, environment.n_states, "observations"),
        (data.action_space, environment.n_actions, "actions"),
    ):
        if space != gymnasium.spaces.Discrete(number):
            raise DemoError(f"the dataset's {what} are {space}; the environment has {number}")
    ids = range(data.total_episodes)
    metadata = data.storage.get_episode_metadata(ids)
    pairs = zip(data.iterate_episodes(ids), metadata, strict=True)
    demos = [_demo(episode, facts) for episode, facts in pairs]
    return Demos(
        task or about.get("task", "minari"),
        environment,
        tuple(demo for demo in demos if demo.kind == "correct"),
        tuple(demo for demo in demos if demo.kind != "correct"),
        about.get("description", ""),
    )


def _demo(episode: Any, facts: dict[str, Any]) -> Demo:
    correct = facts.get("success", bool(episode.terminations[-1]))
    kind = str(facts.get("kind", "correct" if correct else "failure"))
    name = str(facts.get("name", f"episode {episode.id}"))
    return Demo(name, kind, episode.observations, episode.actions)


def _about(dataset: Any) -> dict[str, Any]:
    """Return what :func:`to_minari` noted; nothing if somebody else wrote the dataset."""
    with suppress(ValueError, TypeError):
        about = parse_json(dataset.storage.metadata.get(ABOUT, "{}"))
        return about if isinstance(about, dict) else {}
    return {}


def _environment(about: dict[str, Any]) -> Environment:
    document = {"format": FORMAT, "version": VERSION, "task": "any", "correct": []}
    document["environment"] = about.get("environment")
    try:
        return read_fields(json.dumps(document).encode()).environment.build()
    except DemoError:
        raise UserError(
            "the dataset does not hold what makes its environment again; give `environment`"
        ) from None


def _minari() -> Any:
    need("minari")
    import minari

    return minari


def _line(error: Exception) -> str:
    return " ".join(str(error).split())
