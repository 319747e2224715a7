from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from replication import check_demos, fit, load_demos
from replication.paths import PROJECT

README = (PROJECT / "README.md").read_text(encoding="utf-8")


def test_claims_are_those_in_figures() -> None:
    """The table of claims is the one that the stored results give."""
    command = [sys.executable, str(PROJECT / "tools" / "readme.py"), "--check"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_files_that_are_named_exist() -> None:
    """Every link and picture of the README leads to a file of the project."""
    targets = re.findall(r"\]\(([^)#:]+)\)", README)
    assert targets
    assert [target for target in targets if not (PROJECT / target).exists()] == []


def test_make_targets_that_are_named_exist() -> None:
    """Every `make` command of the README is a target of the Makefile."""
    named = set(re.findall(r"make ([a-z]+)\b", README)) - {"and"}
    makefile = (PROJECT / "Makefile").read_text(encoding="utf-8")
    assert named <= set(re.findall(r"^([a-z]+):", makefile, flags=re.MULTILINE))


def test_example_demonstration_can_be_learned(tmp_path: Path) -> None:
    """The JSON example loads without a warning and both Python lines do what they say."""
    example = re.search(r"```json\n(.*?)```", README, flags=re.DOTALL)
    assert example is not None
    path = tmp_path / "mine.json"
    path.write_text(example[1], encoding="utf-8")
    assert check_demos(path) == []
    result = fit(load_demos(path), method="unified-incorrect", seed=1)
    assert result.converged
    result.save(tmp_path / "result.json")
