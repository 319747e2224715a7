"""The pages on tasks of one's own are executed as they stand."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import pytest

from replication import Fit
from replication.files import PROJECT


def run(page: str, monkeypatch: pytest.MonkeyPatch, folder: Path) -> dict[str, Any]:
    """Run the Python of a page in a folder of its own; return its names."""
    monkeypatch.chdir(folder)
    text = (PROJECT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    for number, block in enumerate(re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            exec(compile(block, f"{page}.md, block {number + 1}", "exec"), names)
    return names


def test_a_task_in_ten_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The river is crossed, with and without chance, and a table has a row for each seed."""
    names = run("task", monkeypatch, tmp_path)
    saved = Fit.load(
        tmp_path / "river.json",
        task=names["TabularTask"](
            names["moves"], start=0, terminal=[3, 4], actions=("swim", "drift")
        ),
    )
    assert saved.converged
    assert [action for _, action in saved.path] == ["swim"] * 3 + [""]
    assert names["result"].policy()[:3].tolist() == [0, 0, 0]
    assert names["table"]["seed"].tolist() == [0, 1, 2, 3, 4]


def test_your_gymnasium_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The cliff is passed, and the pole is balanced for most of the time from a new start."""
    names = run("gymnasium", monkeypatch, tmp_path)
    assert names["result"].converged
    assert names["steps"] > 200


def test_use_the_reward_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another learner finds the demonstrated way by the learned reward."""
    names = run("reward", monkeypatch, tmp_path)
    assert names["found"] == names["way"]
