from __future__ import annotations

import ast
from pathlib import Path

import pytest

from replication.files import PROJECT

PACKAGE = PROJECT / "replication"
MODULES = {
    ".".join(path.relative_to(PROJECT).with_suffix("").parts).removesuffix(".__init__"): path
    for path in sorted(PACKAGE.rglob("*.py"))
    if path.parent != PACKAGE or path.name != "__init__.py"
}
GROUND = ("errors", "files", "source", "progress")
FLOORS = (
    *("paper", "envs", "demos", "recording", "learning", "irl", "trials"),
    *("baselines", "evidence", "report", "lab"),
    *("site", "export", "result", "fitting", "learned_reward", "cli", "__main__"),
)
"""The order of the argument: a part imports from those before it, and from the ground floor."""

MAY_IMPORT = {
    **dict.fromkeys(GROUND, GROUND),
    **{part: (*GROUND, *FLOORS[: i + 1]) for i, part in enumerate(FLOORS)},
    "irl": ("errors", "paper", "learning", "irl"),
    "pipeline": (*GROUND, "pipeline"),
    "site": (*GROUND, "pipeline", *FLOORS[:12]),
    "export": (*GROUND, "pipeline", "evidence", "export"),
    "cli": (*GROUND, "pipeline", *FLOORS),
}

METHODS = (".open", ".fdopen", ".read_text", ".read_bytes")
FUNCTIONS = ("open", "json.load", "json.loads", "nbformat.read", "np.load", "pd.read_csv")
"""What opens a file, or reads JSON of any depth."""

MAY_OPEN = {
    "replication.__main__": "opens the null device",
    "replication.files": "is the door",
    "replication.source": "reads the package's code",
    "replication.paper.register": "reads a resource of the package",
    "replication.lab.page": "reads resources of the package",
    "replication.demos.strict_json": "is stricter",
    "replication.trials.store": "reads what SQLite returns",
    "replication.progress": "reads what a kernel of ours wrote",
    "replication.pipeline.driver": "reads the scratch folder of its run",
    "replication.pipeline.execute": "reads the scratch folder of its run",
    "replication.cli": "reads its options and what it has just written",
}

SCIENCE = ("paper/register.py", "paper/params.py", "envs/maze.py", "learning/reference.py")


def imported(path: Path) -> set[str]:
    """Return what a file imports of the package, wherever in the file: modules, else names."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            whole = {f"{node.module}.{alias.name}" for alias in node.names}
            names |= whole if whole <= MODULES.keys() else {node.module, *(whole & MODULES.keys())}
    return {name for name in names if name.split(".")[0] == "replication"}


def part(module: str) -> str:
    """Return the folder, or the file beside the folders, in which a module stands."""
    return module.partition(".")[2].partition(".")[0]


@pytest.mark.parametrize("module", MODULES)
def test_arrows_go_one_way(module: str) -> None:
    """A module imports only from its own part of the package and from the parts below."""
    assert {part(name) for name in imported(MODULES[module])} <= set(MAY_IMPORT[part(module)])


def opens(node: ast.AST) -> bool:
    """Return whether some code opens a file or reads JSON; not if it is made in the same place."""
    if not isinstance(node, ast.Call):
        return False
    name = ast.unparse(node.func)
    given = ast.unparse(node.args[0]) if node.args else ""
    made = given.startswith(("BytesIO(", "io.BytesIO(", "json.dumps("))
    return (name.endswith(METHODS) or name in FUNCTIONS) and not made


@pytest.mark.parametrize("module", sorted(MODULES.keys() - MAY_OPEN.keys()))
def test_files_have_one_door(module: str) -> None:
    """What a user may have put somewhere is read through `replication.files` alone."""
    tree = ast.parse(MODULES[module].read_bytes())
    assert [ast.unparse(node) for node in ast.walk(tree) if opens(node)] == []


def test_no_two_modules_import_each_other() -> None:
    """Within a part, too, there is no circle of imports."""
    waiting = {name: imported(path) for name, path in MODULES.items()}
    while free := [name for name, needs in waiting.items() if not needs & waiting.keys()]:
        for name in free:
            del waiting[name]
    assert not waiting


def test_the_science_can_be_read_in_an_hour() -> None:
    """Register, parameters, maze, reference learner and IRL together have at most 1,300 lines."""
    files = [PACKAGE / name for name in SCIENCE] + sorted((PACKAGE / "irl").glob("*.py"))
    assert sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files) <= 1300


@pytest.mark.parametrize("module", MODULES)
def test_a_large_module_says_why(module: str) -> None:
    """A module of more than 10 kB says in its docstring that, and why, it is one file."""
    content = MODULES[module].read_bytes()
    if len(content) > 10_000:
        words = (ast.get_docstring(ast.parse(content)) or "").lower().split()
        assert "one file because" in " ".join(words)
