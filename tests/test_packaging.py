"""What is installed, and where: the wheel, its extras, the container."""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
from importlib import metadata
from pathlib import Path
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from replication import fit, load_demos, stored
from replication.errors import EXTRAS
from replication.files import PROJECT, STORED

TABLE = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
BROUGHT = {"IPython": "ipykernel", "docutils": "sphinx", "llvmlite": "numba"}
"""Modules that come with a package that is asked for, which cannot do without them."""

BUILD = "import sys; from setuptools import build_meta; build_meta.build_{}(sys.argv[1])"


def names_of(requirements: list[str]) -> set[str]:
    """Return the names of the packages that requirements ask for."""
    return {canonicalize_name(Requirement(text).name) for text in requirements}


def test_extras_are_those_that_are_declared() -> None:
    """Each module that the code looks for is brought by the extra that it names."""
    brought = metadata.packages_distributions()
    for extra, modules in EXTRAS.items():
        declared = names_of(TABLE["optional-dependencies"][extra])
        for module in modules:
            assert {canonicalize_name(name) for name in brought[module]} & declared


def test_every_import_is_declared() -> None:
    """What the package imports is a requirement of the core, or of an extra that is looked for."""
    declared = set(TABLE["dependencies"]).union(*map(TABLE["optional-dependencies"].get, EXTRAS))
    allowed = names_of(list(declared))
    brought = metadata.packages_distributions()
    for path in (PROJECT / "replication").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_bytes())):
            whole = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            whole += [name.name for name in node.names] if isinstance(node, ast.Import) else []
            for module in {name.partition(".")[0] for name in whole}:
                if module in sys.stdlib_module_names or module == "replication":
                    continue
                owners = [BROUGHT[module]] if module in BROUGHT else brought.get(module, [module])
                assert {canonicalize_name(name) for name in owners} & allowed, (path, module)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build a wheel from the archive of sources that is built from the project, as others would."""
    folder = tmp_path_factory.mktemp("build")
    project = folder / "project"
    for name in ("replication", "data/demos"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(PROJECT / name, project / name, symlinks=True, ignore=ignored)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy2(PROJECT / name, project)
    build(project, "sdist", folder)
    with tarfile.open(next(folder.glob("*.tar.gz"))) as archive:
        archive.extraction_filter = getattr(tarfile, "data_filter", None)  # new in Python 3.11.4
        archive.extractall(folder / "unpacked")
    build(next((folder / "unpacked").iterdir()), "wheel", folder)
    return next(folder.glob("*.whl"))


def build(project: Path, kind: str, folder: Path) -> None:
    """Build a project by the build backend that is installed."""
    command = [sys.executable, "-c", BUILD.format(kind), str(folder)]
    done = subprocess.run(command, cwd=project, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_wheel_holds_the_package(wheel: Path) -> None:
    """It has each module, what modules read, the stored demonstrations and the mark of types."""
    package = PROJECT / "replication"
    kinds = ("py", "toml", "html", "css", "js", "wat", "wasm", "typed")
    kept = [path for kind in kinds for path in package.rglob(f"*.{kind}")]
    expected = {path.relative_to(PROJECT).as_posix(): path.read_bytes() for path in kept}
    for path in (PROJECT / "data" / "demos").glob("*.json"):
        expected[f"replication/stored/{path.name}"] = path.read_bytes()
    with ZipFile(wheel) as archive:
        found = {name: archive.read(name) for name in archive.namelist() if "-info/" not in name}
    assert found == expected
    assert {f"replication/stored/{name}.json" for name in STORED} < found.keys()
    assert "replication/py.typed" in found


def core(wheel: Path) -> set[str]:
    """Return the names of all packages that a wheel without extras needs."""
    with ZipFile(wheel) as archive:
        text = archive.read(next(name for name in archive.namelist() if name.endswith("/METADATA")))
    waiting = [line[15:] for line in text.decode().splitlines() if line.startswith("Requires-Dist")]
    found: set[str] = set()
    while waiting:
        wanted = Requirement(waiting.pop())
        applies = wanted.marker is None or wanted.marker.evaluate({"extra": ""})
        if applies and wanted.name not in found:
            found.add(wanted.name)
            waiting += metadata.requires(wanted.name) or []
    return found


@pytest.fixture(scope="module")
def bare(wheel: Path) -> Path:
    """Install the wheel where there is nothing but what it needs; return the folder of programs."""
    folder = wheel.parent / "bare"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    needed = folder / "needed"
    needed.mkdir()
    for name in core(wheel):
        package = metadata.distribution(name)
        for top in {file.parts[0] for file in package.files or []} - {"..", "__pycache__"}:
            if not (needed / top).exists():
                (needed / top).symlink_to(Path(str(package.locate_file(top))))
    site = next(folder.glob("lib/python*/site-packages"))
    (site / "needed.pth").write_text(f"{needed}\n")
    pip = [sys.executable, "-m", "pip", "--python", str(folder / "bin" / "python"), "--quiet"]
    subprocess.run([*pip, "install", "--no-index", "--no-deps", str(wheel)], check=True)
    return folder / "bin"


@pytest.mark.long
def test_wheel_works_alone(bare: Path, tmp_path: Path) -> None:
    """In an empty folder, the documented example gives the same bits as here; commands work."""

    def run(*words: str | Path, code: int = 0) -> str:
        environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
        done = subprocess.run(
            words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == code, done.stderr
        return done.stdout + done.stderr

    run(bare / "python", "-c", "import pytest", code=1)  # nothing of this environment is seen
    page = (PROJECT / "docs" / "api" / "index.md").read_text(encoding="utf-8")
    example = re.search(r"```python\n(.*?)```", page, flags=re.DOTALL)
    assert example is not None
    run(bare / "python", "-c", example[1])
    here = fit(load_demos(stored("open_maze")), method="unified-incorrect", seed=1)
    here.save(tmp_path / "here.json")
    assert (tmp_path / "result.json").read_bytes() == (tmp_path / "here.json").read_bytes()

    (tmp_path / "map.txt").write_text("....G\n.##..\nS....\n")
    replicate = bare / "replicate"
    run(replicate, "demos", "make", "map.txt", "--task", "mine", "--out", "mine.json")
    assert run(replicate, "demos", "check", "mine.json") == "mine.json: ok\n"
    assert "picture: build/learn/mine-" in run(replicate, "learn", "mine.json")
    assert "lab.html in a browser" in run(replicate, "lab", "--out", "lab.html")
    line = run(replicate, "run", code=2)
    assert "clone the repository" in line
    assert line.count("\n") == 1


def test_containers_name_what_exists() -> None:
    """Files, targets and versions that the container and the workflows name are there."""
    docker = (PROJECT / "Dockerfile").read_text(encoding="utf-8")
    stages = re.findall(r"^FROM (?:python:([\d.]+)-slim AS )?(\w+)$", docker, flags=re.MULTILINE)
    assert [stage for _, stage in stages] == ["tools", "tools"]
    supported = re.findall(r":: Python :: (3\.\d+)", " ".join(TABLE["classifiers"]))
    assert stages[0][0] in supported
    targets = re.findall(r"make (\S+)", docker)
    made = (PROJECT / "Makefile").read_text(encoding="utf-8").replace("$(VENV)", ".venv")
    assert all(f"\n{target}:" in made for target in targets if target != "\\")

    folder = PROJECT / ".devcontainer"
    container = json.loads((folder / "devcontainer.json").read_text(encoding="utf-8"))
    build = container["build"]
    assert (folder / build["dockerfile"]).samefile(PROJECT / "Dockerfile")
    assert (folder / build["context"]).samefile(PROJECT)
    assert build["target"] == "tools"
    assert container["postCreateCommand"] in docker

    tests = (PROJECT / ".github" / "workflows" / "test.yml").read_text(encoding="utf-8")
    matrix = re.search(r"python: (\[.*\])", tests)
    assert matrix is not None
    assert json.loads(matrix[1]) == supported
    assert "run: bash .ci/run" in tests
    assert (PROJECT / ".ci" / "run").exists()
