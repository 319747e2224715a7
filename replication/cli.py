"""The command `replicate`.

A mistake of the user is one line on stderr and exit code 2; a run that fails has exit code 1, an
interrupted one 130. Modules that take long to import are imported by the commands that need them.
"""

from __future__ import annotations

import atexit
import json
import math
import os
import re
import shutil
import signal
import sys
import textwrap
import time
import warnings
from collections.abc import Sequence
from enum import StrEnum
from importlib import metadata
from itertools import zip_longest
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperCommand, TyperGroup

from replication import files

CLEANING = 5.0
"""Seconds after an interruption in which another one is not heard: a run is then cleaning up."""


class Profile(StrEnum):
    """How much is run."""

    QUICK = "quick"
    PAPER = "paper"


class OneLineErrors(TyperGroup):
    """Says a user's mistake in one line; a fault of the program keeps its traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            _fail("interrupted", 130)
        except ValueError as error:
            if not type(error).__module__.startswith("replication."):
                raise
            _fail(str(error))
        except OSError as error:
            if error.filename is None:
                raise
            _fail(f"{error.filename}: {(error.strerror or str(error)).lower()}")


class TwoWords(TyperCommand):
    """Lets `-p NAME VALUE` take two words; typer's lists hold single ones."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Join the two words of each `-p`, then parse as usual."""
        joined: list[str] = []
        rest = list(args)
        while rest and rest[0] != "--":
            word = rest.pop(0)
            if word == "-p":
                if len(rest) < 2 or not rest[0].isidentifier():
                    _fail("-p takes two words, a parameter's name and its value: -p trials 10")
                word = f"-p{rest.pop(0)}={rest.pop(0)}"
            joined.append(word)
        return super().parse_args(ctx, joined + rest)


app = typer.Typer(
    cls=OneLineErrors,
    help="Inverse reinforcement learning from correct and incorrect demonstrations, replicated.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
demos_app = typer.Typer(help="Make and check demonstration files.", no_args_is_help=True)
app.add_typer(demos_app, name="demos")

Pairs = Annotated[
    list[str] | None,
    typer.Option(
        "-p",
        metavar="NAME VALUE",
        help="Set a parameter; VALUE is JSON, or else text. May be repeated.",
    ),
]


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"replicate {metadata.version('unified-irl-replication')}")
        raise typer.Exit


@app.callback()
def main(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Take the options that come before a command."""


@app.command(
    cls=TwoWords, epilog="Example: replicate run open_maze --profile quick -p set_trials 4"
)
def run(
    notebooks: Annotated[
        list[str] | None,
        typer.Argument(metavar="NOTEBOOK", help="Names or paths; all by default."),
    ] = None,
    profile: Annotated[
        Profile, typer.Option(help="The paper's number of trials, or a few.")
    ] = Profile.PAPER,
    jobs: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Worker processes; one a usable core by default."),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, metavar="N", help="Root seed; the notebook's by default.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Where the outputs go.")
    ] = None,
    timeout: Annotated[
        int, typer.Option(min=1, metavar="SECONDS", help="Time that one cell may take.")
    ] = 3600,
    force: Annotated[
        bool,
        typer.Option("--force", help="Run what is up to date, too; compute every trial again."),
    ] = False,
    here: Annotated[
        bool,
        typer.Option("--here", help="Run what is up to date, too, if it was made elsewhere."),
    ] = False,
    scheduler: Annotated[
        str,
        typer.Option(metavar="ADDRESS", help="Send trials to a Dask scheduler: tcp://HOST:PORT."),
    ] = "",
    parameters: Pairs = None,
) -> None:
    """Run notebooks and publish their figures, tables and data.

    A notebook is skipped if nothing that its outputs depend on has changed. Outputs go to figures;
    those of --profile quick to build/quick, and those of a run with --seed or with -p (but for jobs
    and store) to build/custom.
    """
    from replication.pipeline.folders import executed_folder, outputs_folder
    from replication.pipeline.notebook import RunError
    from replication.pipeline.plan import run_name
    from replication.pipeline.run import run_notebooks

    _catch_signals()
    files = [_notebook(one) for one in notebooks] if notebooks else _all_notebooks()
    values = _values(parameters)
    name = run_name(profile.value, seed=seed, parameters=values)
    target = out or outputs_folder(name)
    try:
        published = run_notebooks(
            list(dict.fromkeys(files)),
            profile=profile.value,
            out=target,
            jobs=jobs,
            seed=seed,
            parameters=values,
            timeout=timeout,
            force=force,
            here=here,
            scheduler=scheduler,
            echo=typer.echo,
        )
    except KeyboardInterrupt:
        kept = "finished notebooks" if force else "finished notebooks and trials"
        _fail(f"interrupted; {kept} are kept, and the same command goes on from there", 130)
    except RunError as error:
        if error.details:
            plain = re.sub(r"\x1b\[[0-9;]*[A-Za-z]", "", error.details)
            typer.echo(error.details if sys.stderr.isatty() else plain, err=True)
        _fail(str(error), 1)
    for table in published:
        if table.suffix == ".md" and table.stem != "claims":
            typer.echo(f"\n{table.name}\n\n{table.read_text(encoding='utf-8').strip()}")
    typer.echo(f"\noutputs ({len(published)} new): {_short(target)}")
    typer.echo(f"executed notebooks: {_short(executed_folder(target, name))}")
    if any(file.stem == "claims" for file in files) and (target / "claims.csv").exists():
        from replication.evidence.tables import read_table, verdict_lines

        lines = verdict_lines(read_table(target / "claims.csv"))
        typer.echo("\nThe paper's claims:\n" + "\n".join(lines))


@app.command(epilog="Example: replicate status")
def status(
    profile: Annotated[
        Profile, typer.Option(help="The profile that the outputs belong to.")
    ] = Profile.PAPER,
    out: Annotated[Path | None, typer.Option(metavar="FOLDER", help="The outputs.")] = None,
) -> None:
    """Say which figures and tables are up to date, why others are not, and what to do."""
    from replication.pipeline.folders import executed_folder, outputs_folder
    from replication.pipeline.plan import prepare
    from replication.pipeline.status import status_lines

    target = out or outputs_folder(profile)
    runs = prepare(_all_notebooks(), profile=profile)
    folder = executed_folder(target, profile)
    options = ["--profile", profile.value] if profile is not Profile.PAPER else []
    options += ["--out", str(out)] if out else []
    typer.echo("\n".join(status_lines(runs, target, folder, options)))


@app.command(epilog="Example: replicate verify")
def verify(
    profile: Annotated[
        Profile, typer.Option(help="The profile that the outputs belong to.")
    ] = Profile.PAPER,
    out: Annotated[Path | None, typer.Option(metavar="FOLDER", help="The outputs.")] = None,
    jobs: Annotated[int | None, typer.Option(min=1, metavar="N", help="Worker processes.")] = None,
) -> None:
    """Prove the outputs: hash the files, check the packages, recompute one trial in twenty.

    Exit code 0 if everything agrees, else 1.
    """
    import joblib

    from replication.pipeline import verify
    from replication.pipeline.folders import outputs_folder
    from replication.pipeline.plan import prepare

    _catch_signals()
    runs, target = prepare(_all_notebooks(), profile=profile), out or outputs_folder(profile)
    store = files.PROJECT / "build" / "trials.sqlite"
    jobs = jobs or joblib.cpu_count()
    wrong = verify.verify(runs, target, store, jobs=jobs, echo=typer.echo)
    for one in wrong:
        typer.echo(f"error: {one}", err=True)
    typer.echo("everything agrees" if not wrong else f"{len(wrong)} things do not agree")
    raise typer.Exit(int(bool(wrong)))


@app.command(epilog="Example: replicate clean --dry-run")
def clean(
    profile: Annotated[
        Profile, typer.Option(help="The profile that the outputs belong to.")
    ] = Profile.PAPER,
    out: Annotated[Path | None, typer.Option(metavar="FOLDER", help="The outputs.")] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only say what would be removed.")
    ] = False,
) -> None:
    """Remove files among the outputs that no notebook declares, and records of lost notebooks."""
    from replication.pipeline import cleaning
    from replication.pipeline.folders import outputs_folder
    from replication.pipeline.plan import prepare

    runs = prepare(_all_notebooks(), profile=profile)
    cleaning.clean(runs, out or outputs_folder(profile), dry_run=dry_run, echo=typer.echo)


@app.command(epilog="Example: replicate site")
def site(
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Where the site goes.")] = Path(
        "build/site"
    ),
) -> None:
    """Build the report from the published results; nothing is executed."""
    from replication.site.build import build_site

    first = build_site(_all_notebooks(), out, echo=typer.echo)
    typer.echo(f"open {first.resolve().as_uri()} in a browser")


@app.command(cls=TwoWords, epilog="Example: replicate learn mine.json --incorrect hit -p alpha 0.1")
def learn(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A demonstration file.")],
    method: Annotated[
        str, typer.Option(metavar="METHOD", help="adaboost, unified or unified-incorrect.")
    ] = "unified-incorrect",
    seed: Annotated[int, typer.Option(min=0, metavar="N", help="Root seed.")] = 0,
    incorrect: Annotated[
        str | None,
        typer.Option(
            metavar="SET", help="Incorrect demos: all (the default), none, or kinds joined by +."
        ),
    ] = None,
    parameters: Pairs = None,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Where the result goes.")] = Path(
        "build/learn"
    ),
) -> None:
    """Learn a reward from the demonstrations of a file.

    Writes TASK-METHOD.json and a picture of it. A result that has not converged is a result: it
    is reported as such, with exit code 0.
    """
    from replication.demos.files import load_demos
    from replication.fit import fit
    from replication.irl import get_method
    from replication.paper.params import Params
    from replication.report import figures, style

    uses_incorrect = get_method(method).uses_incorrect
    if incorrect not in (None, "none") and not uses_incorrect:
        _fail(f"the method {method!r} uses no incorrect demos; leave out --incorrect")
    values = _values(parameters)
    if "incorrect" in values:
        _fail("-p incorrect is not taken here; choose the incorrect demos with --incorrect SET")
    params = Params.of(incorrect="all", **values)
    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        demos = load_demos(file).select(incorrect or "all")
    result = fit(demos, method=method, params=params, seed=seed)
    stem = out / f"{demos.task}-{method}"
    saved = result.save(f"{stem}.json")
    style.save_figure(figures.fit_figure(result), stem, formats=("png",))
    ended = "converged" if result.converged else "NOT converged"
    typer.echo(
        f"{demos.task}, {method}: {ended} after {result.iterations} iterations, "
        f"d = {result.errors[-1]:.4g}"
    )
    typer.echo(f"result:  {_short(saved)}\npicture: {_short(saved.with_suffix('.png'))}")


@demos_app.command(
    epilog="Example: replicate demos make map.txt --task mine --out mine.json --leg 2"
)
def make(
    map_file: Annotated[
        Path,
        typer.Argument(
            metavar="MAP", help="A text file: . free, # obstacle, S start, G goal; one line a row."
        ),
    ],
    task: Annotated[
        str, typer.Option(metavar="NAME", help="Name of the task, which its files bear.")
    ],
    out: Annotated[Path, typer.Option(metavar="FILE", help="The demonstration file to write.")],
    leg: Annotated[
        int | None,
        typer.Option(metavar="N", help="Cells of a straight leg (choice DEMO-SHAPE)."),
    ] = None,
    detour_width: Annotated[
        int | None,
        typer.Option(metavar="N", help="Cells that a detour keeps off (choice DETOUR-WIDTH)."),
    ] = None,
) -> None:
    """Let the scripted expert demonstrate in a maze of your own.

    Writes one correct demo and incorrect ones of each kind, by the rules of the stored mazes.
    """
    from replication.demos.files import save_demos
    from replication.demos.maze_expert import Expert, demonstrate
    from replication.envs.maze import Maze, MazeError

    given: dict[str, Any] = {"leg": leg, "detour_width": detour_width}
    params = Expert(**{name: value for name, value in given.items() if value is not None})
    try:
        # a byte that is no UTF-8 becomes a character that the map refuses, with its place
        maze = Maze.from_text(map_file.read_text(encoding="utf-8-sig", errors="replace"))
    except MazeError as error:
        _fail(f"{map_file}: {error}")
    demos = demonstrate(task, maze, params=params)
    save_demos(demos, out)
    kinds = [demo.kind for demo in demos.incorrect]
    counts = [f"{kinds.count(kind)} {kind}" for kind in demos.kinds]
    typer.echo(f"{task}: {', '.join([f'{len(demos.correct)} correct', *counts])}")
    typer.echo(f"demos: {_short(out)}")


@demos_app.command(epilog="Example: replicate demos check mine.json")
def check(
    files: Annotated[list[Path], typer.Argument(metavar="FILE", help="Files to check.")],
) -> None:
    """Check demonstration files, move by move.

    A warning is about a file that can be used, an error about one that cannot: exit code 1.
    """
    from replication.demos.checks import DemoError
    from replication.demos.files import check_demos

    failed = False
    for file in files:
        try:
            found = check_demos(file)
        except DemoError as error:
            typer.echo(f"error: {error}", err=True)
            failed = True
            continue
        for warning in found:
            typer.echo(f"warning: {warning}")
        if not found:
            typer.echo(f"{file}: ok")
    raise typer.Exit(int(failed))


@demos_app.command(epilog="Example: replicate demos schema > schema.json")
def schema() -> None:
    """Print the JSON Schema of demonstration files."""
    from replication.demos.schema import json_schema

    typer.echo(json.dumps(json_schema(), indent=2))


@app.command(epilog="Example: replicate choices ALPHA")
def choices(
    id: Annotated[
        str | None, typer.Argument(metavar="ID", help="One choice, to be shown in full.")
    ] = None,
) -> None:
    """List what the paper leaves open, what we chose, and what else is accepted."""
    from replication.errors import unknown
    from replication.paper.register import load_choices

    entries = load_choices()
    width = shutil.get_terminal_size().columns
    if id is None:
        rows = [("ID", "DEFAULT", "ALTERNATIVES", "FIELD, DATA OR CODE")]
        rows += [
            (one.id, str(one.default), _accepted(one), one.field or one.data or one.code)
            for one in entries.values()
        ]
        _print_table(rows, width)
        return
    if id.upper() not in entries:
        _fail(unknown(id.upper(), entries, "choice"))
    one = entries[id.upper()]
    lines = {
        "id": one.id,
        "place": one.place,
        "open": one.open,
        "default": str(one.default),
        "rule": one.rule,
        "alternatives": _accepted(one),
        "field": one.field,
        "data": one.data,
        "code": one.code,
    }
    for key, value in lines.items():
        if value:
            head = f"{key + ':':<14}"
            typer.echo(textwrap.fill(head + value, width, subsequent_indent=" " * 14))


def _accepted(one: Any) -> str:
    if one.range is not None:
        return f"{one.range[0]:g} to {one.range[1]:g}"
    return ", ".join(map(str, one.alternatives))


def _print_table(rows: Sequence[tuple[str, ...]], width: int) -> None:
    """Print rows in columns; the first is never broken, the others share what is left."""
    first = max(len(row[0]) for row in rows)
    share = max(12, (width - first) // (len(rows[0]) - 1) - 2)
    for row in rows:
        cells = [[row[0]], *(textwrap.wrap(cell, share) for cell in row[1:])]
        for parts in zip_longest(*cells, fillvalue=""):
            padded = [f"{part:<{share if at else first}}" for at, part in enumerate(parts)]
            typer.echo("  ".join(padded).rstrip())


def _notebook(name: str) -> Path:
    """Find a notebook by its name or path."""
    path = Path(name)
    if path.suffix == ".ipynb" or len(path.parts) > 1:
        found = files.resolve(path)
        return found if found.exists() else _fail(f"there is no notebook {name}")
    known = [one.stem for one in _all_notebooks()]
    if name not in known:
        from replication.errors import unknown

        _fail(unknown(name, known, "notebook"))
    return files.PROJECT / "notebooks" / f"{name}.ipynb"


def _all_notebooks() -> list[Path]:
    found = sorted((files.PROJECT / "notebooks").glob("*.ipynb"))
    if not found:
        _fail(f"there is no notebook in {files.PROJECT / 'notebooks'}")
    return found


def _values(pairs: list[str] | None) -> dict[str, Any]:
    """Return the values of joined `NAME=VALUE` words."""
    values: dict[str, Any] = {}
    for pair in pairs or []:
        name, _, text = pair.partition("=")
        if name in values:
            _fail(f"-p {name} is given twice")
        try:
            values[name] = json.loads(text, parse_constant=_no_constant)
        except ValueError:
            values[name] = text
    return values


def _no_constant(text: str) -> NoReturn:
    raise ValueError(f"{text} is not JSON")


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    typer.echo(f"warning: {message}", err=True)


def _short(path: Path) -> str:
    """Show a path relative to the working folder where it lies below it."""
    absolute = path.resolve()
    below = absolute.is_relative_to(Path.cwd())
    return os.path.relpath(absolute) if below else str(absolute)


def _catch_signals() -> None:
    """Let a polite kill end like Ctrl-C: kernel and workers stop, and the stage is removed."""
    last = -math.inf

    def interrupt(*_: object) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last > CLEANING:
            last = now
            raise KeyboardInterrupt

    for number in (signal.SIGINT, signal.SIGTERM):
        # While the interpreter ends, it would else give up this handler, and die of the signal.
        atexit.register(signal.signal, number, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, interrupt)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)


def _fail(message: str, code: int = 2) -> NoReturn:
    typer.echo(f"error: {message}", err=True)
    raise typer.Exit(code)
