"""The command line: what it prints, where it writes and how it ends."""

import errno
import json
import os
import re
import resource
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

import nbformat
import pandas as pd
import pytest
from click.testing import CliRunner, Result
from matplotlib.figure import Figure

from replication import Fit, Maze, MazeError, cli, demonstrate, files, load_demos, save_demos
from replication.demos.maze_expert import Expert
from replication.demos.model import Demos
from replication.demos.schema import json_schema
from replication.errors import EXTRAS, UserError
from replication.evidence import claims, specifications
from replication.irl import METHODS
from replication.paper.register import load_choices
from replication.pipeline import run
from tests.notebooks import write_notebook
from tests.terminal import in_terminal

COMMANDS = [
    *(["run"], ["draw"], ["status"], ["verify"], ["copy"], ["clean"], ["site"], ["export"]),
    *(["lab"], ["learn"], ["choices"]),
    *(["demos", name] for name in ("make", "record", "check", "schema")),
]


def replicate(*words: str | Path) -> Result:
    """Run the command in this process."""
    return CliRunner().invoke(cli.app, [str(word) for word in words])


def refused(*words: str | Path, late: bool = False) -> str:
    """Return the error line of a command that must be refused, by a cell if it is `late`."""
    result = replicate(*words)
    assert result.exit_code == 2
    assert late or result.stdout == ""
    assert re.fullmatch(r"error: .+\n", result.stderr)
    return result.stderr


@pytest.fixture
def kernel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set up a project folder with one notebook, `toy`, that writes the table `seen.md`."""
    code = (
        "from pathlib import Path\n"
        "if trials == 0: raise ValueError('no trials')\n"
        "(Path(out) / 'seen.md').write_text(f'| {trials} | {name!r} | {seed} | {jobs} |')"
    )
    declared: dict[str, Any] = {"data": ["seen.md"], "profiles": {"quick": {"trials": 2}}}
    parameters = 'out = "x"\ntrials = 3\nname = "a"\nseed = 1\njobs = 1'
    toy = tmp_path / "notebooks" / "toy.ipynb"
    write_notebook(toy, code, parameters=parameters, **declared)
    (tmp_path / "environment.lock").touch()
    monkeypatch.setattr(files, "PROJECT", tmp_path)
    return tmp_path


@pytest.fixture
def project(kernel: Path, begun: list[str]) -> Path:
    """Set up the same project; its notebook runs in this process."""
    return kernel


@pytest.fixture
def demo_file(tmp_path: Path, small_demos: Demos) -> Path:
    """Write a small demonstration file."""
    path = tmp_path / "small.json"
    save_demos(small_demos, path)
    return path


# --- run -------------------------------------------------------------------------------------


def test_run_writes_and_tells(kernel: Path) -> None:
    """All notebooks run by default; each has a line, and the folder of the outputs is named."""
    words = ["-p", "name", "x=y", "-p", "trials", "-4", "--seed", "9", "--jobs", "2"]
    result = replicate("run", "--profile", "quick", *words)
    assert result.exit_code == 0
    table = "| -4 | 'x=y' | 9 | 2 |"
    assert (kernel / "build" / "custom" / "toy" / "seen.md").read_text() == table
    assert "toy: 1 output in " in result.stdout
    assert f"outputs (2 new): {kernel / 'build' / 'custom'}\n" in result.stdout
    assert not (kernel / "figures").exists()


@pytest.mark.parametrize(
    ("words", "folder"),
    [
        ([], "figures"),
        (["-p", "jobs", "2"], "figures"),
        (["--profile", "quick"], "build/quick"),
        (["--seed", "1"], "build/custom"),
        (["-p", "trials", "3"], "build/custom"),
    ],
)
def test_only_the_paper_as_it_is_goes_to_figures(
    project: Path, words: list[str], folder: str
) -> None:
    """A run that may give other results than the profile's has a folder of its own."""
    assert replicate("run", *words, "--jobs", "1").exit_code == 0
    assert [path.parent for path in project.rglob("seen.md")] == [project / folder / "toy"]


@pytest.mark.parametrize("out", [None, "elsewhere"])
def test_claims_are_shown_last(
    project: Path, monkeypatch: pytest.MonkeyPatch, out: str | None
) -> None:
    """A run that judges the claims ends with the verdicts on each of them."""
    table = (
        "id,claim,place,statistic,reading,set,paper,effect,low,high,p,verdict,why\n"
        "FASTER,It is faster,Table I,saved,printed,none,5,4,2,6,0,shown,\n"
        "FASTER,It is faster,Table I,saved,updated,none,5,1,0,2,0,inconclusive,\n"
        "SD-B,SD,Fig. 6,published-sd,,none,3,2,1,3,,not testable,used\n"
    )
    code = (
        "from pathlib import Path\nfolder = Path(out)\n"
        f"(folder / 'verdicts.csv').write_text({table!r})\n"
        "(folder / 'verdicts.md').write_text('| long table |\\n')"
    )
    write_notebook(project / "notebooks" / "claims.ipynb", code, tables=["verdicts"])
    monkeypatch.chdir(project)
    monkeypatch.setenv("COLUMNS", "80")
    shown = replicate("run", "claims", *(["--out", out] if out else [])).stdout
    assert "long table" not in shown
    assert all(len(line) <= 80 for line in shown.splitlines() if "outputs" not in line)
    assert shown.index("outputs (3 new)") < shown.index("The paper's claims:")
    assert shown.splitlines()[-4:] == [
        "The paper's claims:",
        "faster than AdaBoost-IRL  shown under Fᵢ (printed), inconclusive under Fᵢ₊₁",
        "                          (updated)",
        "SD-B                      not testable: used",
    ]


def test_failing_cell_shows_its_traceback(kernel: Path) -> None:
    """The cell's own traceback, without colours, comes before the error line; exit code 1."""
    result = replicate("run", "toy", "-p", "trials", "0", "--out", kernel / "here")
    assert result.exit_code == 1
    assert "----> 2 if trials == 0" in result.stderr
    assert "\x1b" not in result.stderr
    last = result.stderr.splitlines()[-1]
    assert re.fullmatch(r"error: .*toy\.ipynb: cell 2 failed: ValueError: no trials", last)
    assert [path.name for path in (kernel / "here").glob("*")] == [".lock"]
    assert (kernel / "build" / "failed" / "toy.ipynb").exists()


def test_run_refuses_in_one_line(project: Path) -> None:
    """Unknown notebooks, parameters, types and half options are named in one line."""
    assert "unknown notebook 'toi' (did you mean 'toy'?)" in refused("run", "toi")
    assert "there is no notebook no/such.ipynb" in refused("run", "no/such.ipynb")
    assert "(did you mean 'trials'?)" in refused("run", "-p", "trails", "1")
    assert "'name' is text" in refused("run", "-p", "name", "1")
    assert "'trials' is a whole number" in refused("run", "-p", "trials", "NaN")
    assert "'trials' is a whole number" in refused("run", "-p", "trials", "1.0")
    assert "'-p' requires 2 arguments" in refused("run", "-p", "trials")
    assert "-p takes two words" in refused("run", "-p", "trials=1", "toy")
    assert "-p trials is given twice" in refused("run", "-p", "trials", "1", "-p", "trials", "2")
    twice = refused("run", "-p", "choices", '{"alpha": 0.1, "alpha": 0.9}')
    assert "-p choices: the field 'alpha' appears twice in one object" in twice
    assert "use --out" in refused("run", "-p", "out", "x")
    figures = project / "figures"
    assert "profile 'paper'" in refused("run", "--profile", "quick", "--out", figures)
    assert "a run with -p trials" in refused("run", "-p", "trials", "3", "--out", figures)
    assert "a run with --seed" in refused("run", "--seed", "1", "--out", figures)


@pytest.mark.parametrize(
    "words",
    [["run"], ["draw"], ["status"], ["verify"], ["copy", "toy"], ["clean"], ["site"], ["export"]],
)
def test_what_needs_a_clone_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str]
) -> None:
    """Beside an installed package there are no notebooks: one line, and nothing is written."""
    monkeypatch.setattr(files, "PROJECT", tmp_path)
    monkeypatch.chdir(tmp_path)
    assert "clone the repository and work there: git clone" in refused(*words)
    assert replicate(*words, "--help").exit_code == 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "extra"),
    [
        (["status"], "notebooks"),
        (["run", "--scheduler", "tcp://127.0.0.1:9"], "cluster"),
        (["site"], "site"),
    ],
)
def test_what_needs_an_extra_says_so(
    project: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], extra: str
) -> None:
    """Where a package of an extra is not installed, the command to install it is named."""
    monkeypatch.setitem(EXTRAS, extra, ("no_such_module",))
    line = "no_such_module is not installed; the extra '{0}' has it: pip install '{1}[{0}]'"
    assert refused(*words) == f"error: {line.format(extra, 'unified-irl-replication')}\n"


def test_refusal_in_a_cell_is_one_line(kernel: Path) -> None:
    """A file or choice that only the notebook sees to be wrong has no traceback, and code 2."""
    path = kernel / "notebooks" / "toy.ipynb"
    node = nbformat.read(path, as_version=4)
    node.cells[1].source = "from replication import load_demos\nload_demos('none.json')"
    nbformat.write(node, path)
    assert "none.json: cannot be read (no such" in refused("run", "-p", "name", "none.json")
    result = replicate("run")
    assert result.exit_code == 2
    line = r"error: .*toy\.ipynb: none\.json: cannot be read \(no such file or directory\)\n"
    assert re.fullmatch(line, result.stderr)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("3", 3),
        ("-0.5", -0.5),
        ("true", True),
        ("null", None),
        ('{"a": [1]}', {"a": [1]}),
        ('"3"', "3"),
        ("hit+detour", "hit+detour"),
        ("", ""),
        ("a=b", "a=b"),
        ("Infinity", "Infinity"),
        ("[1,", "[1,"),
    ],
)
def test_values_are_json_or_else_text(text: str, value: object) -> None:
    """What parses as JSON is JSON, everything else is text."""
    assert cli._values(None, None, [("name", text)]) == {"name": value}  # type: ignore[arg-type]


def test_an_interruption_that_was_lost_can_be_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second Ctrl-C does not disturb the cleaning up, and one that comes later is heard."""
    handlers: dict[int, Callable[[], object]] = {}
    clock = [100.0]
    monkeypatch.setattr(signal, "signal", handlers.__setitem__)
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    cli._catch_signals()
    interrupt = handlers[signal.SIGTERM]
    with pytest.raises(KeyboardInterrupt):
        interrupt()
    clock[0] += cli.GRACE / 2
    interrupt()
    clock[0] += cli.GRACE
    with pytest.raises(KeyboardInterrupt):
        interrupt()


def test_what_is_fresh_is_not_run(project: Path) -> None:
    """Help and a second run, which has nothing to do, load nothing that takes long."""
    assert replicate("run").exit_code == 0
    code = (
        "import sys; from pathlib import Path; from replication import cli, files\n"
        "cli.app(['--help'], standalone_mode=False)\n"
        "heavy = {'papermill', 'nbformat', 'jsonschema', 'matplotlib'}\n"
        "print(sorted({*heavy, 'pandas'} & set(sys.modules)))\n"
        f"files.PROJECT = Path({str(project)!r}); cli.app(['run'], standalone_mode=False)\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    assert "outputs (0 new): " in lines[-2]
    assert "[]\ntoy: fresh, nothing to do\n" in done.stdout
    assert lines[-1] == "[]"
    assert "toy: running" in replicate("run", "--force").stdout


def test_check_answers_by_its_exit_code(project: Path) -> None:
    """With --check other bytes than before are an error that names the files; all is published."""
    assert replicate("run", "--check").exit_code == 0
    assert replicate("run", "--check", "--force").exit_code == 0
    path = project / "notebooks" / "toy.ipynb"
    path.write_text(path.read_text().replace("| {trials}", "| so {trials}"))
    result = replicate("run", "--check", "--publish")
    assert result.exit_code == 1
    folder = project / "figures" / "toy"
    assert result.stderr == f"error: other bytes than published before: {folder / 'seen.md'}\n"
    assert (folder / "seen.md").read_text().startswith("| so ")
    assert replicate("run", "--check").exit_code == 0


@pytest.mark.parametrize(
    ("module", "old", "new", "message"),
    [
        (claims, 'statistic = "sd-ratio"', 'statistic = "sd-rato"', "claim STEADIER.statistic"),
        (claims, "soccer = 100", "soccer = 0", "judging.trials.soccer: Input should be greater"),
        (specifications, "trials = 10", "trials = 0", "mazes.factorial.trials: Input should be"),
        (specifications, '["hit", "detour", "op', '["lob", "detour", "op', "soccer.single: "),
        (specifications, '"far-detour", "opposite"', '"overspeed"', "mazes.single: task open-maze"),
    ],
)
def test_bad_plans_are_refused_before_any_notebook_runs(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    module: Any,
    old: str,
    new: str,
    message: str,
) -> None:
    """A mistake in the claims or specifications is found by the check of the file."""
    name = module.__name__.rpartition(".")[2]
    text = module.FILE.read_text(encoding="utf-8")
    assert old in text
    slipped = tmp_path / "slipped.toml"
    slipped.write_text(text.replace(old, new, 1), encoding="utf-8")
    monkeypatch.setattr(module, "FILE", slipped)
    cached = claims.load_claims if module is claims else specifications.load_specifications
    cached.cache_clear()
    try:
        with pytest.raises(UserError, match=f"^{name}.toml, {message}"):
            cli.CHECKS[f"replication/evidence/{name}.toml"]()
    finally:
        cached.cache_clear()


def test_every_check_is_of_a_file() -> None:
    """The files that are checked are there, and are inputs of notebooks."""
    for name in cli.CHECKS:
        assert (files.PROJECT / name).exists()


def test_an_error_of_an_interruption_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a library raises while it is interrupted is no fault of the program."""

    def stopped(*_: object, **__: object) -> None:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt:
            raise RuntimeError("cannot join thread before it is started")  # noqa: B904

    monkeypatch.setattr("replication.pipeline.status.status_lines", stopped)
    result = replicate("status")
    assert (result.exit_code, result.output) == (130, "error: interrupted\n")


# --- status, verify and clean ----------------------------------------------------------------


def test_status_leads_from_missing_to_fresh(project: Path) -> None:
    """The report names the command that brings everything up to date."""
    shown = replicate("status").stdout
    assert shown.startswith("toy: missing\n")
    assert shown.endswith("to bring figures up to date: replicate run toy\n")
    assert replicate("run", "toy").exit_code == 0
    assert replicate("status").stdout == "everything is fresh; replicate verify proves it\n"
    shown = replicate("status", "--all").stdout
    assert re.match(r"toy: fresh \(\d+ s, just now\)\n    fresh    seen \.md\n", shown)
    assert "toy: missing" in replicate("status", "--profile", "quick").stdout
    (project / "figures" / "toy" / "seen.md").write_text("mine")
    shown = replicate("status").stdout
    assert "toy: stale" in shown
    assert "because seen.md is changed" in shown


@pytest.mark.parametrize("words", [["--profile", "quick"], ["--out", "my figures"]])
def test_the_recommended_command_works(
    project: Path, monkeypatch: pytest.MonkeyPatch, words: list[str]
) -> None:
    """What status recommends, typed as it stands, makes just what it was asked about fresh."""
    monkeypatch.chdir(project)
    command = replicate("status", *words).stdout.splitlines()[-1].partition(": ")[2]
    assert replicate(*shlex.split(command)[1:]).exit_code == 0
    last = replicate("status", *words).stdout.splitlines()[-1]
    assert last == f"everything is fresh; {shlex.join(['replicate', 'verify', *words])} proves it"


def test_verify_answers_by_its_exit_code(project: Path) -> None:
    """Everything that is wrong has a line on stderr, and any of it makes the code 1."""
    result = replicate("verify")
    assert result.exit_code == 1
    assert "toy: nothing is published" in result.stderr
    assert replicate("run").exit_code == 0
    result = replicate("verify")
    assert (result.exit_code, result.stderr) == (0, "")
    assert "toy: made again, 3 files have the same bytes\n" in result.stdout
    assert result.stdout.endswith("everything agrees\n")
    assert replicate("verify", "toy").exit_code == 0
    (project / "figures" / "toy" / "seen.md").write_text("mine")
    (project / "environment.lock").write_text("numpy==0.1\n")
    result = replicate("verify")
    assert result.exit_code == 1
    first, second, third = result.stderr.splitlines()
    assert first.startswith("error: numpy ")
    assert second == "error: toy is stale: environment.lock has changed"
    assert third == "error: toy/seen.md is changed since its run"
    assert result.stdout.endswith("3 things do not agree\n")


def test_verify_takes_what_a_notebook_needs(project: Path) -> None:
    """A notebook is as true as the results that it was made from."""
    parameters = 'out = "x"\nresults = "x"'
    code = "from pathlib import Path\n(Path(out) / 'a.md').write_text('| a |')"
    more: dict[str, Any] = {"data": ["a.md"], "needs": ["toy"]}
    write_notebook(project / "notebooks" / "all.ipynb", code, parameters=parameters, **more)
    assert replicate("run", "toy", "all").exit_code == 0
    assert "toy: made again" in replicate("verify", "all").stdout
    assert "all: made again" not in replicate("verify", "toy").stdout
    (project / "figures" / "toy" / "seen.md").write_text("mine")
    assert "error: toy/seen.md is changed" in replicate("verify", "all").stderr


def test_verify_refuses_what_is_not_published(project: Path) -> None:
    """A copy of a notebook has published nothing, whatever its name."""
    assert replicate("run").exit_code == 0
    mine = project / "mine" / "toy.ipynb"
    mine.parent.mkdir()
    shutil.copy(project / "notebooks" / "toy.ipynb", mine)
    assert f"{mine} publishes nothing here; name a notebook" in refused("verify", mine)
    assert replicate("verify", project / "notebooks" / "toy.ipynb").exit_code == 0


def test_an_edited_notebook_goes_elsewhere_and_says_so(project: Path) -> None:
    """What is published is replaced only if --publish is given; --check has nothing to compare."""
    assert replicate("run").exit_code == 0
    seen = project / "figures" / "toy" / "seen.md"
    before = seen.read_bytes()
    path = project / "notebooks" / "toy.ipynb"
    node = nbformat.read(path, as_version=4)
    node.cells[-1].source += "\nedited = 1"
    nbformat.write(node, path)
    assert "the notebook's code has changed" in refused("run", "--check")
    result = replicate("run")
    assert result.exit_code == 0
    assert "the notebook's code has changed since then; --publish replaces it" in result.stdout
    assert (project / "build" / "edited" / "toy" / "seen.md").exists()
    assert "outputs (2 new): " in result.stdout
    assert "keeps what was published" in refused("run", "--out", project / "figures")
    assert seen.read_bytes() == before
    assert "toy: stale" in replicate("status").stdout
    assert replicate("run", "--publish").exit_code == 0
    assert replicate("status").stdout.startswith("everything is fresh")


def test_clean_removes_what_no_notebook_declares(project: Path) -> None:
    """The command does what it says, and says only what it would do if it is asked to."""
    assert replicate("run").exit_code == 0
    (project / "figures" / "toy" / "old.png").touch()
    before = sorted((project / "figures").rglob("*"))
    shown = replicate("clean", "--dry-run").stdout
    assert shown == "would remove toy/old.png\n"
    assert sorted((project / "figures").rglob("*")) == before
    assert replicate("clean").stdout == "removed toy/old.png\n"
    assert sorted((project / "figures").rglob("*")) == [p for p in before if p.name != "old.png"]
    assert replicate("clean").stdout == ""
    assert "has no folder with a provenance.json" in refused("clean", "--out", project)
    assert replicate("status").stdout.startswith("everything is fresh")


# --- learn -----------------------------------------------------------------------------------


def test_learn_writes_result_and_picture(demo_file: Path, tmp_path: Path) -> None:
    """The file can be read again and is what was asked for; the lines say what came out."""
    words = ["--seed", "3", "--incorrect", "hit", "-p", "alpha", "0.1"]
    result = replicate("learn", demo_file, *words, "--out", tmp_path / "out")
    assert result.exit_code == 0
    found = Fit.load(tmp_path / "out" / "small-unified-incorrect.json")
    assert (found.seed, found.params.update.alpha, found.demos.kinds) == (3, 0.1, ("hit",))
    assert found.converged
    assert f"converged after {found.iterations} iterations, d = 0\n" in result.stdout
    picture = tmp_path / "out" / "small-unified-incorrect.png"
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert str(picture) in result.stdout


def test_learn_says_that_it_has_not_converged(demo_file: Path, tmp_path: Path) -> None:
    """A result at the iteration cap is a result, exit code 0, but never called converged."""
    cap = str(load_choices()["ITERATION-CAP"].range[0])  # type: ignore[index]
    words: list[str | Path] = ["--out", tmp_path, "--method", "unified"]
    result = replicate("learn", demo_file, *words, "-p", "max_iterations", cap)
    assert result.exit_code == 0
    assert f"NOT converged after {cap} iteration" in result.stdout
    strict = replicate("learn", demo_file, *words, "-p", "max_iterations", cap, "--strict")
    assert (strict.exit_code, strict.stdout) == (1, result.stdout)
    assert replicate("learn", demo_file, "--out", tmp_path, "--strict").exit_code == 0


def test_learn_refuses_in_one_line(demo_file: Path, tmp_path: Path) -> None:
    """Unknown methods, parameters, kinds and files are named in one line."""
    for name in METHODS:
        assert name in refused("learn", demo_file, "--method", "adabost")
    assert "(did you mean 'alpha'?)" in refused("learn", demo_file, "-p", "alhpa", "1")
    assert "choice ALPHA" in refused("learn", demo_file, "-p", "alpha", "text")
    assert "no incorrect demo of kind 'speed'" in refused(
        "learn", demo_file, "--incorrect", "speed"
    )
    assert "with --incorrect" in refused("learn", demo_file, "-p", "incorrect", "hit")
    words = ["--method", "unified", "--incorrect", "hit"]
    assert "uses no incorrect demos" in refused("learn", demo_file, *words)
    assert "nothing.json" in refused("learn", tmp_path / "nothing.json")
    assert "small.json" in refused("learn", demo_file, "--out", demo_file / "below")


def test_learn_takes_every_kind_of_task(tmp_path: Path) -> None:
    """Soccer is learned and drawn, too."""
    file = files.PROJECT / "data" / "demos" / "soccer.json"
    cap = str(load_choices()["ITERATION-CAP"].range[0])  # type: ignore[index]
    words = ["-p", "max_iterations", cap, "-p", "episodes", "10"]
    result = replicate("learn", file, *words, "--out", tmp_path)
    assert result.exit_code == 0
    assert Fit.load(tmp_path / "soccer-unified-incorrect.json").iterations == int(cap)
    picture = tmp_path / "soccer-unified-incorrect.png"
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_the_lab_is_opened_or_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is opened from one place, or written to one that is named; no clone is needed."""
    opened: list[str] = []
    monkeypatch.setattr("click.launch", opened.append)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(files, "PROJECT", tmp_path)
    assert replicate("lab").exit_code == 0
    page = tmp_path / "build" / "lab.html"
    assert [*tmp_path.iterdir()] == [page.parent]
    assert opened == [page.as_uri()]
    assert replicate("lab", "--out", tmp_path / "new" / "mine.html").exit_code == 0
    assert (tmp_path / "new" / "mine.html").read_bytes() == page.read_bytes()
    assert len(opened) == 1


def test_the_lab_takes_no_other_things_place(tmp_path: Path) -> None:
    """A folder, a pipe or a device stays what it is."""
    os.mkfifo(tmp_path / "pipe")
    for target in (tmp_path, tmp_path / "pipe", Path("/dev/null")):
        assert "is not a regular file" in refused("lab", "--out", target)
    assert not Path("/dev/null").is_file()


def test_learn_computes_nothing_that_it_cannot_save(
    demo_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where a file would not fit, or take the demonstrations' place, nothing is computed."""
    monkeypatch.setattr("replication.fitting.fit", None)
    assert "it is not a folder" in refused("learn", demo_file, "--out", demo_file)
    target = tmp_path / "small-unified-incorrect.json"
    target.mkdir()
    assert "is not a regular file" in refused("learn", demo_file, "--out", tmp_path)
    target.rmdir()
    own = demo_file.rename(target)
    assert "would be overwritten" in refused("learn", own, "--out", tmp_path)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, before[1]))
    try:
        assert "file too large" in refused("learn", own, "--out", tmp_path / "full")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert load_demos(own).task == "small"


def test_learn_asks_for_the_room_that_its_result_takes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A result of a large maze takes more than most; what is asked for is enough."""
    side = 60
    rows = ("S" + "." * (side - 2) + "G", *["." * side] * (side - 1))
    demos = demonstrate("large", Maze(rows))
    save_demos(demos, tmp_path / "large.json")
    asked: list[int] = []
    monkeypatch.setattr(files, "check_writable", lambda folder, size: asked.append(size))
    words = ("--incorrect", "none", "-p", "max_iterations", "2", "-p", "episodes", "50")
    assert replicate("learn", tmp_path / "large.json", *words, "--out", tmp_path).exit_code == 0
    (size,) = asked
    written = (tmp_path / "large-unified-incorrect.json").stat().st_size
    assert files.ROOM + written < size


# --- demos and choices -----------------------------------------------------------------------


def test_check_tells_about_each_file(demo_file: Path, tmp_path: Path) -> None:
    """Good files are ok, bad ones have one line each, and the exit code tells."""
    assert replicate("demos", "check", demo_file).stdout == f"{demo_file}: ok\n"
    bad = tmp_path / "bad.json"
    bad.write_text("{")
    result = replicate("demos", "check", bad, demo_file)
    assert result.exit_code == 1
    assert result.stdout == f"{demo_file}: ok\n"
    assert re.fullmatch(r"error: .*bad\.json.*\n", result.stderr)


def test_check_shows_warnings(demo_file: Path) -> None:
    """A file that can be used, but not matched exactly, has its warnings and exit code 0."""
    document = json.loads(demo_file.read_text())
    first = document["correct"][0]
    actions = sorted(first["actions"])
    detour = {"name": "other", "actions": actions}
    assert actions != first["actions"]
    document["correct"].append(detour)
    demo_file.write_text(json.dumps(document))
    result = replicate("demos", "check", demo_file)
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert all(line.startswith(f"warning: {demo_file}: the correct demos ") for line in lines)
    assert len(lines) == 2


def test_make_writes_what_the_expert_drives(tmp_path: Path) -> None:
    """The file holds the demonstrations of the map, with the registered or the given rules."""
    text = ".......\n.....G.\n.......\n.......\n.S.....\n.......\n"
    drawn, out = tmp_path / "map.txt", tmp_path / "new" / "mine.json"
    drawn.write_text(f"\ufeff\n{text}", encoding="utf-8")
    for params, words in (
        (Expert(), []),
        (Expert(leg=2, detour_width=1), ["--leg", "2", "--detour-width", "1"]),
    ):
        result = replicate("demos", "make", drawn, "--task", "mine", "--out", out, *words)
        assert result.exit_code == 0
        made = load_demos(out)
        assert made == demonstrate("mine", Maze.from_text(text), params=params)
        assert all(kind in result.stdout for kind in made.kinds)
        assert str(out) in result.stdout


def test_make_refuses_in_one_line(tmp_path: Path) -> None:
    """Maps, rules, names and files that cannot be used have one line each; nothing is written."""
    drawn, out = tmp_path / "map.txt", tmp_path / "mine.json"
    drawn.write_text("S.G")
    rest: list[str | Path] = ["--task", "mine", "--out", out]
    assert "choice DEMO-SHAPE" in refused("demos", "make", drawn, *rest, "--leg", "0")
    assert "DETOUR-WIDTH" in refused("demos", "make", drawn, *rest, "--detour-width", "-1")
    assert "none.txt: cannot be read (no s" in refused(
        "demos", "make", tmp_path / "none.txt", *rest
    )
    os.mkfifo(tmp_path / "pipe")
    assert "pipe: is not a regular file" in refused("demos", "make", tmp_path / "pipe", *rest)
    assert "letters, digits" in refused("demos", "make", drawn, "--task", "a b", "--out", out)
    assert "cannot be written" in refused(
        "demos", "make", drawn, "--task", "mine", "--out", tmp_path
    )
    assert "map.txt would be overwritten" in refused(
        "demos", "make", drawn, "--task", "mine", "--out", drawn
    )
    assert "is not a regular file" in refused(
        "demos", "make", drawn, "--task", "mine", "--out", tmp_path / "pipe"
    )
    drawn.write_bytes(b"S.\xffG")
    assert "map.txt: unknown character" in refused("demos", "make", drawn, *rest)
    assert not out.exists()


def test_record_refuses_in_one_line(tmp_path: Path) -> None:
    """Without a place to record in, or a terminal, one line says what to do; nothing is written."""
    drawn, out = tmp_path / "map.txt", tmp_path / "mine.json"
    record = ("demos", "record", out)
    drawn.write_text("S.G")
    assert "needs a terminal; elsewhere" in refused(*record, "--map", drawn)
    assert "say where to record: --map MAP, --env ID" in refused(*record)
    assert "say where to record" in refused(*record, "--map", drawn, "--env", "FrozenLake-v1")
    assert "-p, --actions and --reset-seed are for --env" in refused(
        *record, "--map", drawn, "-p", "a", "1"
    )
    lake = (*record, "--env", "FrozenLake-v1")
    assert "unexpected keyword argument 'slippery'" in refused(*lake, "-p", "slippery", "true")
    assert "names 2 actions; the environment has 4" in refused(*lake, "--actions", "left,right")
    assert "Frozen" in refused(*record, "--env", "FrozenLak-v1")
    assert "have no numbers" in refused(*record, "--env", "CartPole-v1")
    assert "none.txt: cannot be read" in refused(*record, "--map", tmp_path / "none.txt")
    assert not out.exists()


def test_schema_is_printed() -> None:
    """The printed schema is the one that files are checked with."""
    assert json.loads(replicate("demos", "schema").stdout) == json_schema()


@pytest.mark.parametrize("columns", [80, 110])
def test_choices_are_listed(monkeypatch: pytest.MonkeyPatch, columns: int) -> None:
    """Every choice stands under its group, keeps to the terminal and breaks no word."""
    monkeypatch.setenv("COLUMNS", str(columns))
    table = replicate("choices").stdout
    assert max(map(len, table.splitlines())) <= columns
    assert re.search(
        r"^The weight update\n  F-INDEX +printed \(or updated, at-once\)$", table, re.M
    )
    words = set(table.split())
    for id, one in load_choices().items():
        assert {id, *str(one.default).split()} <= words
        whole = replicate("choices", id.lower()).stdout
        assert max(map(len, whole.splitlines())) <= columns
        assert {id, one.field or one.data or one.code, *one.rule.split()} <= {*whole.split()}
    assert "(did you mean 'ALPHA'?)" in refused("choices", "alpa")


# --- a copy to work on -----------------------------------------------------------------------


def test_a_copy_is_made_once(project: Path) -> None:
    """It has the profile's values, writes beside itself, and what was done in it is never lost."""
    shown = replicate("copy", "toy", "--profile", "quick").stdout
    copy = project / "build" / "hand" / "toy.ipynb"
    assert f"open it: jupyter lab {copy}\n" in shown
    assert "trials = 2\n" in nbformat.read(copy, as_version=4).cells[0].source
    copy.write_text("mine")
    assert "toy.ipynb: is there already" in refused("copy", "toy")
    assert copy.read_text() == "mine"
    assert "(did you mean 'toy'?)" in refused("copy", "toi")


# --- draw ------------------------------------------------------------------------------------


def test_draw_uses_the_code_of_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A drawing function gets the table as it is read back; other code is not called."""
    (tmp_path / "fig.csv").write_text("x,y\n1,2\n3,1\n")

    def drawing(numbers: pd.DataFrame) -> Figure:
        figure = Figure()
        figure.subplots().plot(numbers["x"], numbers["y"])
        return figure

    monkeypatch.setattr("replication.report.style.drawing", drawing, raising=False)
    pictures = cli._drawn("replication.report.style.drawing", tmp_path / "fig.csv")
    assert pictures.keys() == {".png", ".svg"}
    assert pictures[".png"].startswith(b"\x89PNG")
    with pytest.raises(UserError, match="only functions of the package"):
        cli._drawn("os.system", tmp_path / "fig.csv")


def test_draw_without_outputs_draws_nothing(project: Path) -> None:
    """Where nothing is published there is no figure."""
    assert replicate("draw").stdout == "0 figures drawn; the others have the same bytes\n"
    assert "unknown figure 'fig05'" in refused("draw", "fig05")


def test_draw_and_site_need_a_folder(project: Path, tmp_path: Path) -> None:
    """A file in the place of the outputs or of the site is refused first, and stays."""
    file = tmp_path / "file"
    file.write_text("mine")
    for words in (["draw"], ["site"], ["draw", "--profile", "quick"]):
        assert "not a folder" in refused(*words, "--out", file)
    assert file.read_text() == "mine"


# --- the rest --------------------------------------------------------------------------------


def test_version() -> None:
    """The version is the installed package's."""
    version = metadata.version("unified-irl-replication")
    assert replicate("--version").stdout == f"replicate {version}\n"


def test_faults_of_the_program_keep_their_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only errors that the package raises on purpose are taken for the user's."""
    for error, code in ((MazeError("mine"), 2), (ValueError("numpy's"), 1)):

        def fail(error: ValueError = error) -> None:
            raise error

        monkeypatch.setattr("replication.demos.schema.json_schema", fail)
        result = replicate("demos", "schema")
        assert result.exit_code == code
        assert ("error: mine" in result.stderr) == (code == 2)


def test_what_is_nested_too_deeply_is_refused(demo_file: Path) -> None:
    """However deep a value is, and whether or not it ends, it is refused in one line."""
    for levels in (cli.LEVELS + 1, 500, 50_000):
        for text in ("[" * levels + "]" * levels, '{"a":' * levels + "1" + "}" * levels):
            words: list[str | Path] = ["learn", demo_file, "-p", "alpha", text]
            assert "-p alpha is nested too deeply" in refused(*words)
    assert "-p alpha is nested too deeply" in refused("run", "-p", "alpha", "[" * 100_000)
    assert cli._values(None, None, [("a", "[" * cli.LEVELS + "]" * cli.LEVELS)])  # type: ignore[arg-type]


@pytest.mark.parametrize("command", COMMANDS)
def test_names_are_unicode(command: list[str]) -> None:
    """A path with bytes that are no text is refused in one line by every command."""
    assert "'a\\udcff' is not Unicode text" in refused(*command, "a\udcff")


@pytest.mark.parametrize("command", COMMANDS)
def test_the_working_folder_may_be_gone(
    command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every command says so in one line."""
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    try:
        assert "the working folder is gone" in refused(*command, "word")
    finally:
        os.chdir(tmp_path)


def test_an_error_of_the_system_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk or a limit, met by a write that names no file, is no fault of the program."""

    def full() -> None:
        raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))

    monkeypatch.setattr("replication.demos.schema.json_schema", full)
    result = replicate("demos", "schema")
    assert (result.exit_code, result.stderr) == (1, "error: the system refuses: file too large\n")


def test_a_cell_without_room_is_one_line(kernel: Path) -> None:
    """A cell that finds the disk full has no traceback, for its code is not at fault."""
    path = kernel / "notebooks" / "toy.ipynb"
    node = nbformat.read(path, as_version=4)
    node.cells[1].source = "import errno, os\nraise OSError(errno.EFBIG, os.strerror(errno.EFBIG))"
    nbformat.write(node, path)
    result = replicate("run")
    assert result.exit_code == 1
    assert re.fullmatch(r"error: .* cell 2 failed: OSError: .*File too large\n", result.stderr)


def test_misuse_is_one_line() -> None:
    """An unknown option or command, and a value that cannot be, have one line and a way on."""
    assert "No such option '--jbs'" in refused("run", "--jbs", "2")
    assert "see replicate run --help" in refused("run", "--jobs", "0")
    assert "No such command 'rum'" in refused("rum")
    assert replicate("run", "-h").stdout == replicate("run", "--help").stdout


def test_the_command_alone_shows_its_help() -> None:
    """Who types nothing else wants to know what there is, and has made no mistake."""
    for words in ([], ["demos"]):
        result = replicate(*words)
        assert (result.exit_code, result.output) == (0, replicate(*words, "--help").stdout)


def test_notebooks_are_completed(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A shell that asks how a word may go on is told the names of notebooks."""
    words = {"COMP_WORDS": "replicate run t", "COMP_CWORD": "2"}
    asked = {"_REPLICATE_COMPLETE": "bash_complete", **words}
    for name, value in asked.items():
        monkeypatch.setenv(name, value)
    assert CliRunner().invoke(cli.app, [], prog_name="replicate").stdout == "plain,toy\n"


@pytest.mark.parametrize("columns", [80, 110])
def test_colours_are_for_terminals(project: Path, columns: int) -> None:
    """A terminal has colours unless NO_COLOR is set; a pipe never has."""
    code = (
        "import sys; from pathlib import Path; from replication import cli, files\n"
        f"files.PROJECT = Path({str(project)!r}); cli.app(['status'])"
    )
    plain = replicate("status").output
    assert plain.startswith("toy: missing\n")
    told = in_terminal("-c", code, columns=columns, cwd=project)
    assert told == plain.replace("missing", "\x1b[33mmissing\x1b[0m", 1)
    assert in_terminal("-c", code, columns=columns, cwd=project, NO_COLOR="1") == plain


def test_help_knows_every_method() -> None:
    """The methods that the help of `learn` names are those of the registry."""
    shown = "".join(replicate("learn", "--help").stdout.split())
    for name in METHODS:
        assert name in re.split(r"METHOD|\.|,|or(?=unified)", shown)


def test_time_limit_has_one_default() -> None:
    """The help shows the limit that the library has."""
    assert f"default: {run.TIMEOUT}" in replicate("run", "--help").stdout
