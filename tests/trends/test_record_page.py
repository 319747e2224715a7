"""The page on recording is executed as it stands."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from replication import load_demos
from replication.files import PROJECT
from tests.terminal import Typist

PAGE = (PROJECT / "docs" / "record.md").read_text(encoding="utf-8")
RIGHT, UP, DOWN = "\x1b[C", "\x1b[A", "\x1b[B"
GOAL = {"mine": RIGHT * 4 + UP * 2, "ice": DOWN * 2 + RIGHT + DOWN + RIGHT * 2}


def blocks(language: str) -> list[str]:
    """Return the page's blocks of code in a language."""
    return re.findall(rf"```{language}\n(.*?)```", PAGE, flags=re.DOTALL)


def test_commands_of_the_page_record(tmp_path: Path) -> None:
    """Each command records a demonstration by the keys that the page names."""
    drawn, _ = blocks("text")
    (tmp_path / "map.txt").write_text(drawn)
    commands = re.findall(r"^    \.venv/bin/replicate (.*)$", PAGE, flags=re.MULTILINE)
    assert len(commands) == 3
    for command in commands:
        words = shlex.split(command, comments=True)
        name = words[2].removesuffix(".json")
        at = Typist("-m", "replication", *words, cwd=tmp_path)
        at.see("save and quit")
        at.press(GOAL[name] + "\r\rq", f"demos: {name}.json")
        assert at.end() == 0
    assert len(load_demos(tmp_path / "mine.json").correct) == 2
    assert len(load_demos(tmp_path / "ice.json").correct) == 1


def test_python_of_the_page_runs(tmp_path: Path) -> None:
    """The blocks run one after the other; what comes back from Minari is what was read."""
    pytest.importorskip("minari")
    pytest.importorskip("h5py")
    _, steps = blocks("text")
    (tmp_path / "steps.csv").write_text(steps)
    record, read, share = blocks("python")
    check = (
        "assert result.converged\n",
        "read = demos\n",
        "assert (demos.correct, demos.incorrect) == (read.correct, read.incorrect)\n"
        "print('\\x1b[Hend', len(demos.correct), demos.kinds)\n",
    )
    code = "".join(map("".join, zip((record, read, share), check, strict=True)))
    at = Typist("-c", code, cwd=tmp_path, MINARI_DATASETS_PATH=str(tmp_path / "minari"))
    at.see("save and quit")
    at.press(GOAL["ice"] + "\r\rq", "end 1 ('hole',)")
    assert at.end() == 0
