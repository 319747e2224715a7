from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from replication import check_demos, fit, load_demos
from replication.files import PROJECT

README = (PROJECT / "README.md").read_text(encoding="utf-8")
PAGES = {
    path.relative_to(PROJECT).as_posix(): path.read_text(encoding="utf-8")
    for path in (PROJECT / "README.md", PROJECT / "CONTRIBUTING.md", *PROJECT.glob("docs/*.md"))
    if path.name != "index.md"  # its links are those of the site
}


@pytest.fixture(scope="module")
def tool() -> Any:
    """Import the tool that writes the README."""
    spec = importlib.util.spec_from_file_location("readme", PROJECT / "tools" / "readme.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_readme_and_findings_are_up_to_date() -> None:
    """The answer and the findings are those that the published results give."""
    command = [sys.executable, str(PROJECT / "tools" / "readme.py"), "--check"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_readme_is_read_in_a_minute() -> None:
    """It has at most 120 lines and 900 words."""
    assert len(README.splitlines()) <= 120
    assert len(README.split()) <= 900


@pytest.mark.parametrize("marks", ["{0}{0}{1}", "{0}{1}{1}", "{0}", "{1}", "{1}{0}", ""])
def test_a_mark_that_is_not_there_once_is_refused(tool: Any, marks: str) -> None:
    """A second or missing mark is an error: the text behind it would become stale unseen."""
    with pytest.raises(tool.MarkError, match=r"README\.md: "):
        tool.fill(marks.format(tool.BEGIN, tool.END), "answer")


def test_the_answer_stands_between_the_marks(tool: Any) -> None:
    """What was there is replaced, and the text around it stays."""
    text = f"before{tool.BEGIN}old{tool.END}after"
    assert tool.fill(text, "new") == f"before{tool.BEGIN}\n\nnew\n\n{tool.END}after"


@pytest.mark.parametrize("name", PAGES)
def test_links_lead_to_files(name: str) -> None:
    """Every relative link and picture of a page leads to a file or folder of the project."""
    targets = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", PAGES[name])
    folder = (PROJECT / name).parent
    assert [target for target in targets if not (folder / target).exists()] == []


@pytest.mark.parametrize("name", PAGES)
def test_make_targets_that_are_named_exist(name: str) -> None:
    """Every `make` command of a page is a target of the Makefile."""
    named = re.findall(r"(?:^ +|`)make ([a-z-]+)\b", PAGES[name], flags=re.MULTILINE)
    makefile = (PROJECT / "Makefile").read_text(encoding="utf-8")
    assert set(named) <= set(re.findall(r"^([a-z-]+):", makefile, flags=re.MULTILINE))


def test_example_of_the_readme_runs() -> None:
    """Its lines of Python learn the path of the demonstration."""
    example = re.search(r"```python\n(.*?)```", README, flags=re.DOTALL)
    assert example is not None
    names: dict[str, Any] = {}
    exec(example[1], names)
    assert names["result"].converged


def test_example_demonstration_can_be_learned(tmp_path: Path) -> None:
    """The example of a file loads without a warning and the Python beside it does what it says."""
    page = PAGES["docs/demonstrations.md"]
    example = re.search(r"```json\n(.*?)```", page, flags=re.DOTALL)
    assert example is not None
    path = tmp_path / "mine.json"
    path.write_text(example[1], encoding="utf-8")
    assert check_demos(path) == []
    result = fit(load_demos(path), method="unified-incorrect", seed=1)
    assert result.converged
    result.save(tmp_path / "result.json")
