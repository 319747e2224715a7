from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from replication import source
from replication.files import PROJECT

MODULES = {
    "__init__": "",
    "top": '''
"""About the top."""

from __future__ import annotations

from toy.middle import twice


def four() -> int:
    """Return four."""
    return twice(2)  # a comment
''',
    "middle": "import toy.bottom\n\n\ndef twice(x):\n    return toy.bottom.FACTOR * x\n",
    "bottom": "FACTOR = 2\n",
    "other": "X = 1\n",
}


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """Return a function that edits a toy package and returns the hash of its top module."""
    folder = tmp_path / "toy"
    folder.mkdir()
    for name, text in MODULES.items():
        (folder / f"{name}.py").write_text(text)
    monkeypatch.setattr(source, "PACKAGE", "toy")
    monkeypatch.setattr(source, "FOLDER", folder)
    source._read.cache_clear()

    def hashed(name: str = "top", old: str = "", new: str = "") -> str:
        text = MODULES[name]
        assert old in text
        (folder / f"{name}.py").write_text(text.replace(old, new) if old else text)
        found = source.source_hash.__wrapped__("toy.top")
        (folder / f"{name}.py").write_text(text)
        return found

    return hashed


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("top", '"""About the top."""', '"""Said otherwise."""'),
        ("top", '"""About the top."""', ""),
        ("top", '"""Return four."""', '"""Return 4.\n\n    At length.\n    """'),
        ("top", "  # a comment", ""),
        ("top", "return twice(2)", "return twice(\n        2,\n    )"),
        ("bottom", "FACTOR = 2", "# why\nFACTOR = (2)\n'''A factor.'''"),
        ("other", "X = 1", "X = 2"),
    ],
)
def test_prose_and_layout_do_not_count(
    name: str, old: str, new: str, toy: Callable[..., str]
) -> None:
    """Docstrings, comments, layout, and modules that are not imported leave the hash alone."""
    assert toy(name, old, new) == toy()


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("top", "twice(2)", "twice(3)"),
        ("top", "def four", "def cuatro"),
        ("middle", "* x", "+ x"),
        ("bottom", "FACTOR = 2", "FACTOR = 3"),
        ("bottom", "FACTOR = 2", "FACTOR = 2.0"),
        ("bottom", "FACTOR = 2", "FACTOR = '2'"),
        ("middle", "import toy.bottom\n", "import toy.bottom\nimport toy.other\n"),
    ],
)
def test_code_counts(name: str, old: str, new: str, toy: Callable[..., str]) -> None:
    """An edit of code in a module that is imported, directly or not, changes the hash."""
    assert toy(name, old, new) != toy()


def test_imports_within_functions_count(toy: Callable[..., str]) -> None:
    """A module that is imported late is one that computes."""
    late = "def four() -> int:\n    from toy import other"
    assert toy("top", "def four() -> int:", late) != toy(
        "top", "def four() -> int:", late.replace("other", "__init__")
    )


def test_a_text_that_is_a_value_counts(toy: Callable[..., str]) -> None:
    """Only a text that stands alone is prose."""
    assert toy("bottom", "FACTOR = 2", "FACTOR = 'a'") != toy(
        "bottom", "FACTOR = 2", "FACTOR = 'b'"
    )


def test_each_module_has_a_hash_of_its_own(toy: Callable[..., str], tmp_path: Path) -> None:
    """The hashes name the module whose code changed, and no other package's modules."""
    before = source.module_hashes(["toy.top", "toy.no_module", "numpy", "nowhere.at_all"])
    assert list(before) == ["toy.bottom", "toy.middle", "toy.top"]
    assert source.module_hashes(["toy.top"]) == before
    (tmp_path / "toy" / "bottom.py").write_text("FACTOR = 3  # three")
    after = source.module_hashes(["toy.top"])
    assert [name for name in after if after[name] != before[name]] == ["toy.bottom"]


@pytest.mark.parametrize(
    ("text", "bare"),
    [
        ("x=1 # one", "x = 1"),
        ('"""Prose."""\nx = (1)', "x = 1"),
        ("%matplotlib inline # so", "%matplotlib inline # so"),
        ("x = 'a' # b", "x = 'a'"),
    ],
)
def test_bare_source_has_no_prose(text: str, bare: str) -> None:
    """Cells lose comments, layout and lone texts; what is not Python stays as it is."""
    assert source.bare_source(text) == bare


KEY = (
    *("replication.trials.compute", "replication.trials.table_agent"),
    *("replication.irl.unified", "replication.irl.adaboost"),
)
"""What the keys of trials in a maze hash, together with what these modules import."""


@pytest.fixture
def hashed() -> set[str]:
    """Return the names of the modules that are read for the hash of a trial in a maze."""
    return set(source._closure(KEY, without=source.SILENT))


def test_drawing_and_reporting_do_not_count(hashed: set[str]) -> None:
    """A trial's hash covers what computes it, and neither figures nor tables nor the program."""
    for name in ("trials.condition", "learning.qlearning", "irl.expectations", "irl.loop"):
        assert f"replication.{name}" in hashed
    for name in ("report", "evidence", "pipeline", "site", "envs.soccer.world", "demos.files"):
        assert (PROJECT / "replication" / name.replace(".", "/")).exists() or "." in name
        assert not [module for module in hashed if module.startswith(f"replication.{name}")]
    for name in ("cli", "progress", "errors", "trials.store", "trials.run"):
        assert (PROJECT / "replication" / f"{name.replace('.', '/')}.py").exists()
        assert f"replication.{name}" not in hashed


def test_hash_covers_all_that_python_loads(hashed: set[str]) -> None:
    """Each module of the package that Python loads for a trial is in the hash, or is silent."""
    program = f"""
import sys
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
spec = spec_from_file_location("replication", {str(PROJECT / "replication" / "__init__.py")!r})
sys.modules["replication"] = module_from_spec(spec)  # its own imports are not executed
for name in {KEY!r}:
    import_module(name)
loaded = [name for name in sys.modules if name.startswith("replication.")]
print(*(name for name in loaded if not hasattr(sys.modules[name], "__path__")))
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    loaded = set(done.stdout.split())
    assert "replication.irl.loop" in loaded
    assert loaded - source.SILENT <= hashed


def test_modules_that_are_named_in_a_text_count(toy: Callable[..., str], tmp_path: Path) -> None:
    """Outputs depend on modules that are imported by name; a trial's key names its own."""
    (tmp_path / "toy" / "late.py").write_text(
        "from importlib import import_module\nM = 'toy.other'"
    )
    assert set(source.module_hashes(["toy.late"])) == {"toy.late", "toy.other"}
    assert set(source._closure(["toy.late"])) == {"toy.late"}


@pytest.mark.parametrize(
    ("code", "names"),
    [
        ("import toy.top, numpy", ["toy.top"]),
        ("from toy import top", ["toy.top"]),
        ("from toy import four", ["toy"]),
        ("%time\n!ls\nfrom toy.bottom import FACTOR", ["toy.bottom"]),
        ("from toy.bottom import (", []),
    ],
)
def test_imports_of_a_cell(toy: Callable[..., str], code: str, names: list[str]) -> None:
    """Modules of the package count; the package itself where a name of its own is imported."""
    assert source.imports_of(code) == names


def test_no_module_hides_its_imports() -> None:
    """The hash does not follow relative imports, so the package has none."""
    modules = list((PROJECT / "replication").rglob("*.py"))
    assert len(modules) > 20
    for path in modules:
        assert "from ." not in path.read_text(encoding="utf-8"), path.name


def test_hash_is_the_same_again() -> None:
    """The hash does not depend on the order in which modules are found."""
    again = source.source_hash.__wrapped__("replication.trials.compute")
    assert again == source.source_hash("replication.trials.compute")
    assert len(again) == 64
