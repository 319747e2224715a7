"""The command `replicate`.

A mistake of the user is one line on stderr and exit code 2; a run that fails has exit code 1, an
interrupted one 130. Modules that take long to import are imported by the commands that need them.
One file because the commands are one surface: they share options, errors and signals.
"""

from __future__ import annotations

import errno
import json
import math
import os
import re
import secrets
import shlex
import shutil
import signal
import sys
import tempfile
import textwrap
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

import click

from replication import files
from replication.errors import UserError, need, show, unknown

GRACE = 5.0
"""Grace period after Ctrl-C, in seconds: further signals are ignored during clean-up."""

NO_ROOM = [os.strerror(number) for number in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT)]
"""How the messages of errors say that a disk is full, whichever cell's write finds out."""

LEVELS = 10
"""Levels of lists and objects that the value of a parameter may have."""


class OneLineErrors(click.Group):
    """Reports a user's mistake in one line; a fault of the program keeps its traceback."""

    def main(self, *args: Any, standalone_mode: bool = True, **extra: Any) -> Any:
        """Run the command, and end with its exit code unless told otherwise."""
        command = partial(super().main, *args, standalone_mode=False, **extra)
        if not standalone_mode:
            return command()
        try:
            code: Any = command()
        except click.exceptions.NoArgsIsHelpError as error:
            click.echo(error.message)
            sys.exit(0)
        except click.ClickException as error:
            context = getattr(error, "ctx", None)
            more = f" (see {context.command_path} --help)" if context else ""
            _end(f"{error.format_message().rstrip('.')}{more}", error.exit_code)
        except UserError as error:
            _end(str(error))
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            if error.filename is None:  # a full disk, a limit, no temporary folder
                _end(f"the system refuses: {reason}", 1)
            _end(f"{error.filename}: {reason}")
        sys.exit(code if isinstance(code, int) else 0)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Refuse what no file of ours could hold and no terminal show."""
        for word in args:
            if any("\ud800" <= character <= "\udfff" for character in word):
                raise UserError(f"{show(word)} is not Unicode text; give the file another name")
        return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; click itself would report an interruption in two lines."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            _end("interrupted", 130)
        except Exception as error:
            if _is_interruption(error):
                _end("interrupted", 130)
            raise


class InClone(click.Command):
    """Works on the notebooks and what they publish, which only a clone of the repository has."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command if this is a clone where the notebooks could run."""
        files.check_clone()
        need("notebooks")
        return super().invoke(ctx)


def _is_interruption(error: BaseException | None) -> bool:
    """Return whether an error came up while an interruption was dealt with.

    Libraries that are stopped half-way in starting threads or processes may raise another error.
    """
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _end(message: str, code: int = 2) -> NoReturn:
    _say(f"error: {message}", err=True)
    sys.exit(code)


COLOURS = {
    "error:": "red",
    **dict.fromkeys(("warning:", "stale", "missing", "NOT converged"), "yellow"),
    **dict.fromkeys(("everything is fresh", "everything agrees", "converged"), "green"),
}
"""Words that are coloured where a line begins, or behind its first colon."""


def _say(text: str, *, err: bool = False) -> None:
    """Print a line beside whatever bar there is; click keeps colours to terminals."""
    from replication.progress import between_bars

    if not os.environ.get("NO_COLOR"):
        words = "|".join(COLOURS)
        pattern = rf"^((?:\w[^:]*: )??)({words})(?=[ ;]|$)"
        text = re.sub(pattern, lambda found: found[1] + _coloured(found[2]), text, count=1)
    with between_bars():
        click.echo(text, err=err)


def _coloured(word: str) -> str:
    return click.style(word, fg=COLOURS[word])


def _values(_: click.Context, __: click.Parameter, pairs: Sequence[tuple[str, str]]) -> Any:
    """Return the values of `-p NAME VALUE` options: what parses as JSON is JSON, the rest text."""
    values: dict[str, Any] = {}
    for name, text in pairs:
        if not name.isidentifier():
            raise UserError("-p takes two words, a parameter's name and its value: -p trials 10")
        if name in values:
            raise UserError(f"-p {name} is given twice")
        try:
            values[name] = json.loads(
                text, parse_constant=_no_constant, object_pairs_hook=_once(name)
            )
            deep = _levels(values[name]) > LEVELS
        except UserError:
            raise
        except ValueError:
            values[name], deep = text, False
        except RecursionError:
            deep = True
        if deep:
            raise UserError(f"-p {name} is nested too deeply; no parameter has {LEVELS} levels")
    return values


def _levels(value: Any) -> int:
    """Return how deeply a JSON value is nested."""
    inner = value.values() if isinstance(value, dict) else value
    return 1 + max(map(_levels, inner), default=0) if isinstance(value, dict | list) else 0


def _once(name: str) -> Callable[[list[tuple[str, Any]]], dict[str, Any]]:
    def fields(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        try:
            return files.fields(pairs)
        except ValueError as error:
            raise UserError(f"-p {name}: {error}") from None

    return fields


def _no_constant(text: str) -> NoReturn:
    raise ValueError(f"{text} is not JSON")


FILE = click.Path(path_type=Path)

parameters_option = click.option(
    "-p",
    "parameters",
    nargs=2,
    multiple=True,
    callback=_values,
    metavar="NAME VALUE",
    help="Set a parameter; VALUE is JSON, or else text. May be repeated.",
)


def number(name: str, least: int | None, text: str, **more: Any) -> Callable[..., Any]:
    """Return an option that takes a whole number, not below the least one."""
    kind = click.INT if least is None else click.IntRange(least)
    return click.option(name, type=kind, help=text, **{"metavar": "N"} | more)


def folder(text: str, default: Path | None = None) -> Callable[..., Any]:
    """Return the option --out."""
    return click.option("--out", type=FILE, default=default, metavar="FOLDER", help=text)


def _complete(_: click.Context, __: click.Parameter, begun: str) -> list[str]:
    """Return the notebooks that a shell may complete a word to."""
    return [path.stem for path in _all_notebooks() if path.stem.startswith(begun)]


notebooks_argument = click.argument(
    "notebooks", metavar="[NOTEBOOK]...", nargs=-1, shell_complete=_complete
)
jobs_option = number("--jobs", 1, "Worker processes; one for each usable core by default.")
profile_option = click.option(
    "--profile",
    type=click.Choice(["quick", "paper"]),
    default="paper",
    help="The published number of trials, or a few.",
)


def outputs_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Let --profile and --out choose published outputs."""
    return profile_option(folder("The outputs.")(command))


@click.group(
    "replicate",
    cls=OneLineErrors,
    context_settings={"help_option_names": ["-h", "--help"], "show_default": True},
    help="Inverse reinforcement learning from correct and incorrect demonstrations, replicated.",
)
@click.version_option(
    package_name="unified-irl-replication", message="replicate %(version)s", prog_name="replicate"
)
def app() -> None:
    """Take the options that come before a command."""
    try:
        Path.cwd()
    except OSError:
        raise UserError("the working folder is gone; change to another one") from None


@app.group("demos")
def demos_group() -> None:
    """Make and check demonstration files."""


# --- notebooks -------------------------------------------------------------------------------


@app.command(cls=InClone, epilog="Example: replicate run open_maze --profile quick -p set_trials 4")
@notebooks_argument
@profile_option
@jobs_option
@number("--seed", 0, "Root seed; the notebook's by default.")
@folder("Where the outputs go.")
@number("--timeout", 1, "Time that one cell may take.", default=3600, metavar="SECONDS")
@click.option(
    "--publish", is_flag=True, help="Replace what is published in figures, although it was edited."
)
@click.option("--force", is_flag=True, help="Re-run everything, and recompute every trial.")
@click.option(
    "--here", is_flag=True, help="Also re-run notebooks whose outputs were made on another machine."
)
@click.option("--check", is_flag=True, help="Exit code 1 if files have other bytes than before.")
@click.option(
    "--scheduler",
    default="",
    show_default=False,
    metavar="ADDRESS",
    help="Send trials to a Dask scheduler: tcp://HOST:PORT.",
)
@parameters_option
def run(
    notebooks: tuple[str, ...],
    profile: str,
    seed: int | None,
    out: Path | None,
    publish: bool,
    force: bool,
    check: bool,
    parameters: dict[str, Any],
    **options: Any,
) -> None:
    """Run notebooks and publish what they give.

    All notebooks by default. One is skipped if nothing that its outputs depend on has changed.
    Outputs go to figures; those of --profile quick to build/quick, and those of a run with --seed
    or with -p (but for jobs and store) to build/custom. If a notebook, its data or the code was
    edited since its outputs were published, they go to build/edited unless --publish is given.
    """
    from replication.pipeline.notebook import RunError
    from replication.pipeline.run import destination, run_notebooks

    if options["scheduler"]:
        need("cluster")
    _catch_signals()
    named = [_notebook(name) for name in notebooks] or _all_notebooks()
    paths = list(dict.fromkeys(named))
    asked: dict[str, Any] = {"profile": profile, "seed": seed, "parameters": parameters}
    target, why = (out, "") if out else destination(paths, publish=publish, **asked)
    if why and check:
        raise UserError(f"{why}; so there is nothing to --check against")
    if why:
        _say(f"{why}: the outputs of this run go to {_short(target)}")
    try:
        published = run_notebooks(
            paths,
            out=target,
            publish=publish,
            force=force,
            checks=CHECKS,
            echo=_say,
            **asked,
            **options,
        )
    except KeyboardInterrupt:
        kept = "finished notebooks" if force else "finished notebooks and trials"
        _end(f"interrupted; {kept} are kept, and the same command goes on from there", 130)
    except RunError as error:
        if error.details and not any(reason in str(error) for reason in NO_ROOM):
            plain = re.sub(r"\x1b\[[0-9;]*[A-Za-z]", "", error.details)
            click.echo(error.details if sys.stderr.isatty() else plain, err=True)
        _end(str(error), 1)
    except UserError as error:
        _end(str(error))
    new = [file for notebook in published for file in notebook.files]
    _say(f"outputs ({len(new)} new): {_short(target)}")
    verdicts = target / "claims" / "verdicts.csv"
    if any(path.stem == "claims" for path in paths) and verdicts.exists():
        from replication.evidence.tables import read_table
        from replication.report.readable import verdict_lines

        lines = verdict_lines(read_table(verdicts), shutil.get_terminal_size().columns)
        _say("\n".join(["", "The paper's claims:", *lines]))
    changed = [_short(file) for notebook in published for file in notebook.changed]
    if check and changed:
        _end(f"other bytes than published before: {', '.join(changed)}", 1)


def _check_claims() -> None:
    from replication.evidence.claims import load_claims

    load_claims()


def _check_specifications() -> None:
    from replication.evidence.specifications import check_declared

    check_declared()


CHECKS: dict[str, Callable[[], object]] = {
    "replication/evidence/claims.toml": _check_claims,
    "replication/evidence/specifications.toml": _check_specifications,
}
"""What is checked before a notebook runs that reads one of these files."""


@app.command(cls=InClone, epilog="Example: replicate draw fig05")
@click.argument("names", metavar="[NAME]...", nargs=-1)
@outputs_options
def draw(names: tuple[str, ...], profile: str, out: Path | None) -> None:
    """Redraw figures from the tables beside them.

    All figures by default; nothing is executed. A NAME is that of a figure, such as fig05 or
    open_maze/fig05, or of a notebook.
    """
    from replication.pipeline.folders import outputs_folder
    from replication.pipeline.redraw import redraw

    _catch_signals()
    target = out or outputs_folder(profile)
    files.check_writable(target)
    redraw(target, names, draw=_drawn, echo=click.echo)


def _drawn(code: str, table: Path) -> dict[str, bytes]:
    """Draw a figure by a function of the package; return its files by suffix."""
    from replication.evidence.tables import read_table
    from replication.report.style import save_figure

    module, _, name = code.rpartition(".")
    if not module.startswith("replication."):
        raise UserError("only functions of the package draw")
    figure = getattr(import_module(module), name)(read_table(table))
    with files.scratch_folder() as folder:
        paths = save_figure(figure, folder / "figure", ("png", "svg"))
        return {path.suffix: path.read_bytes() for path in paths}


@app.command(cls=InClone, epilog="Example: replicate status")
@outputs_options
@click.option("--all", is_flag=True, help="Show every notebook, figure and table.")
def status(profile: str, out: Path | None, all: bool) -> None:
    """Show what is not up to date, and why.

    One line when all is well; otherwise also the command that brings it up to date.
    """
    from replication.pipeline.status import status_lines

    options = ["--profile", profile] if profile != "paper" else []
    options += ["--out", str(out)] if out else []
    for line in status_lines(*_prepared(profile, out), options, all=all):
        _say(line)


@app.command(cls=InClone, epilog="Example: replicate verify open_maze")
@notebooks_argument
@outputs_options
@jobs_option
@number("--every", 1, "Recompute one trial in so many.", default=20)
@number("--seed", 0, "Of the sample of trials; drawn anew by default.")
@number("--timeout", 1, "Time that one cell may take.", default=3600, metavar="SECONDS")
def verify(notebooks: tuple[str, ...], jobs: int | None, **options: Any) -> None:
    """Prove the outputs of notebooks, and of those that they need.

    Those of all notebooks by default. What should be there follows from the notebooks and
    environment.lock. Each notebook is executed again with its published trials, and must give the
    same bytes. Of the trials, a random sample is computed again from nothing. Exit code 0 if
    everything agrees, else 1.
    """
    import joblib

    _catch_signals()
    files.check_writable(Path(tempfile.gettempdir()))
    published = {path.resolve() for path in _all_notebooks()}
    for path in map(_notebook, notebooks):
        if path.resolve() not in published:
            raise UserError(f"{path} publishes nothing here; name a notebook, such as open_maze")
    names = [_notebook(name).stem for name in notebooks]
    number = 0
    for line in _disagreements(names, jobs=jobs or joblib.cpu_count(), **options):
        number += 1
        _say(f"error: {line}", err=True)
    _say("everything agrees" if not number else f"{number} things do not agree")
    sys.exit(int(number > 0))


def _disagreements(
    names: Sequence[str],
    *,
    profile: str,
    out: Path | None,
    jobs: int,
    every: int,
    seed: int | None,
    timeout: int,
) -> Iterator[str]:
    """Check everything; say what is being done, and yield what is wrong."""
    from replication.evidence.recompute import recompute_trials
    from replication.pipeline import verify
    from replication.pipeline.declaration import TRIALS

    every_run, target = _prepared(profile, out)
    wanted = {run.name for run in every_run if not names or run.name in names}
    for run in reversed(every_run):  # each stands behind what it needs
        wanted.update(run.notebook.declared.needs if run.name in wanted else ())
    runs = [run for run in every_run if run.name in wanted]
    _say("comparing the installed packages with environment.lock")
    yield from verify.verify_packages(files.PROJECT / "environment.lock")
    _say(f"comparing what is in {target.name} with what the notebooks declare")
    yield from verify.verify_folder(every_run, target)
    sound = []
    for run in runs:
        wrong = list(verify.verify_records(run))
        yield from wrong
        sound += [] if wrong else [run]
    for run in sound:
        with files.scratch_folder() as scratch:
            yield from verify.verify_outputs(run, scratch.resolve(), timeout=timeout, echo=_say)
    root = secrets.randbits(32) if seed is None else seed

    def report(number: int) -> None:
        _say(f"recomputing {number} trials, one in {every}, drawn with --seed {root}")

    yield from recompute_trials(
        {
            f"{run.name}/{TRIALS}": run.folder / TRIALS
            for run in sound
            if run.notebook.declared.trials
        },
        files.PROJECT / "build" / "trials.sqlite",
        seed=root,
        every=every,
        jobs=jobs,
        report=report,
    )


@app.command(cls=InClone, epilog="Example: replicate copy open_maze --profile quick")
@click.argument("notebook", shell_complete=_complete)
@profile_option
def copy(notebook: str, profile: str) -> None:
    """Copy a notebook to build/hand, to work on it by hand.

    The copy has the profile's values in its first code cell. Nothing that is published or kept
    under version control changes when it is executed or saved.
    """
    from replication.pipeline.by_hand import HAND, copy_notebook
    from replication.pipeline.folders import outputs_folder
    from replication.pipeline.plan import prepare

    (run,) = prepare([_notebook(notebook)], profile=profile, out=outputs_folder(profile))
    made = copy_notebook(run)
    _say(f"copy: {_short(made)}, which writes to {HAND}/{run.name}")
    _say(f"open it: {shlex.join(['jupyter', 'lab', _short(made)])}")


@app.command(cls=InClone, epilog="Example: replicate clean --dry-run")
@outputs_options
@click.option("--dry-run", is_flag=True, help="Only show what would be removed.")
def clean(profile: str, out: Path | None, dry_run: bool) -> None:
    """Remove outputs that no notebook declares any more."""
    from replication.pipeline import status

    _catch_signals()
    status.clean(*_prepared(profile, out), dry_run=dry_run, echo=click.echo)


@app.command(cls=InClone, epilog="Example: replicate site")
@folder("Where the site goes.", Path("build/site"))
def site(out: Path) -> None:
    """Build the report from published results.

    Nothing is executed.
    """
    need("site")
    from replication.site.build import build_site

    _catch_signals()
    if out.exists() and not out.is_dir():
        raise UserError(f"{out} is not a folder; choose another one")
    files.check_writable(out.absolute().parent)  # where the new site stands beside the old one
    first = build_site(_all_notebooks(), out, echo=click.echo)
    click.echo(f"open {first.resolve().as_uri()} in a browser")


@app.command(epilog="Example: replicate lab --out lab.html")
@click.option(
    "--out",
    type=FILE,
    metavar="FILE",
    help="Write the page to this file, and do not open it; by default build/lab.html is opened.",
)
def lab(out: Path | None) -> None:
    """Draw mazes and watch the methods learn, in the browser.

    The page needs no network and no server. In a clone it can also check published trials.
    """
    from replication.lab.page import lab_page

    _catch_signals()
    path = out or Path("build/lab.html")
    _check_targets(path)
    figures = files.PROJECT / "figures"
    page = lab_page(figures if figures.is_dir() else None)
    files.write_file(path, page)
    click.echo(f"open {path.resolve().as_uri()} in a browser")
    if out is None:
        click.launch(path.resolve().as_uri())


@app.command(cls=InClone, epilog="Example: replicate export")
@folder("Where the export goes.", Path("build/export"))
def export(out: Path) -> None:
    """Export published results for other programs.

    Writes an RO-Crate of the runs and the verdicts with the files that it describes, and in it
    codemeta.json and croissant.json. Nothing is executed.
    """
    need("site")
    from replication.export.write import write_export

    _catch_signals()
    files.check_writable(out.absolute().parent)  # where the new folder stands beside the old one
    click.echo(f"export: {_short(write_export(_all_notebooks(), out, echo=click.echo))}")


# --- demonstrations --------------------------------------------------------------------------


@app.command(epilog="Example: replicate learn mine.json --incorrect hit -p alpha 0.1")
@click.argument("file", type=FILE)
@click.option(
    "--method",
    default="unified-incorrect",
    metavar="METHOD",
    help="adaboost, unified or unified-incorrect. Baselines: see docs/methods.md.",
)
@number("--seed", 0, "Root seed.", default=0)
@click.option(
    "--incorrect",
    metavar="SET",
    help="Incorrect demos: all (the default), none, or kinds joined by +.",
)
@parameters_option
@folder("Where the result goes.", Path("build/learn"))
@click.option("--strict", is_flag=True, help="Exit code 1 if the result has not converged.")
def learn(
    file: Path,
    method: str,
    seed: int,
    incorrect: str | None,
    parameters: dict[str, Any],
    out: Path,
    strict: bool,
) -> None:
    """Learn a reward from the demonstrations of a file.

    Writes TASK-METHOD.json and a picture of it. A result that has not converged is a result: it
    is reported as such, with exit code 0 unless --strict is given.
    """
    from replication.baselines import find_method
    from replication.demos.files import load_demos
    from replication.fitting import fit, own_params
    from replication.progress import iteration_meter
    from replication.report.style import save_figure

    _catch_signals()
    uses_incorrect = find_method(method).uses_incorrect
    if incorrect not in (None, "none") and not uses_incorrect:
        raise UserError(f"the method {method!r} uses no incorrect demos; leave out --incorrect")
    if "incorrect" in parameters:
        raise UserError("-p incorrect is not taken here; choose the demos with --incorrect SET")
    with _plain_warnings():
        demos = load_demos(file).select(incorrect or "all")
    params = own_params(demos, **parameters)
    stem = out / f"{demos.task}-{method}"
    saved, picture = stem.with_suffix(".json"), stem.with_suffix(".png")
    environment = demos.environment
    size = BYTES * environment.n_states * environment.n_actions
    _check_targets(saved, picture, source=file, size=size)
    _say(f"{demos.task}, {method}: learning")
    with _plain_warnings(), iteration_meter() as report:
        result = fit(demos, method=method, params=params, seed=seed, report=report)
    result.save(saved)
    save_figure(result.plot(), stem, formats=("png",))
    ended = "converged" if result.converged else "NOT converged"
    why = f" (no smaller d in {params.loop.plateau})" if result.stopped == "plateau" else ""
    _say(
        f"{demos.task}, {method}: {ended} after {result.iterations} iterations{why}, "
        f"d = {result.error:.4g}"
    )
    _say(f"result:  {_short(saved)}\npicture: {_short(picture)}")
    sys.exit(int(strict and not result.converged))


@demos_group.command(
    epilog="Example: replicate demos make map.txt --task mine --out mine.json --leg 2"
)
@click.argument("map_file", metavar="MAP", type=FILE)
@click.option("--task", required=True, metavar="NAME", help="Name of the task.")
@click.option(
    "--out", required=True, type=FILE, metavar="FILE", help="The demonstration file to write."
)
@number("--leg", None, "Cells of a straight leg (choice DEMO-SHAPE).")
@number("--detour-width", None, "Cells that a detour keeps off (choice DETOUR-WIDTH).")
def make(map_file: Path, task: str, out: Path, **rules: int | None) -> None:
    """Let the scripted expert demonstrate in a maze of your own.

    MAP is a text file, one line a row: . free, # obstacle, S start, G goal. Writes one correct demo
    and incorrect ones of each kind, by the rules of the stored mazes.
    """
    from replication.demos.files import save_demos, summary
    from replication.demos.maze_expert import Expert, demonstrate

    _catch_signals()
    given: dict[str, Any] = {name: value for name, value in rules.items() if value is not None}
    params = Expert(**given)
    maze = _maze(map_file)
    _check_targets(out, source=map_file)
    demos = demonstrate(task, maze, params=params)
    save_demos(demos, out)
    click.echo(f"{task}: {summary(demos)}\ndemos: {_short(out)}")


def _maze(file: Path) -> Any:
    """Return the maze of a text file."""
    from replication.envs.maze import Maze, MazeError

    # a byte that is no UTF-8 becomes a character that the map refuses, with its place
    text = files.read_file(file, 1_000_000).decode("utf-8-sig", errors="replace")
    try:
        return Maze.from_text(text)
    except MazeError as error:
        raise UserError(f"{file}: {error}") from error


@demos_group.command("record", epilog="Example: replicate demos record mine.json --map map.txt")
@click.argument("file", type=FILE)
@click.option("--map", "map_file", type=FILE, metavar="MAP", help="A maze, as for `demos make`.")
@click.option("--env", metavar="ID", help="A Gymnasium environment; -p sets its options.")
@click.option("--actions", metavar="NAMES", help="Names of its actions, joined by commas.")
@number("--reset-seed", 0, "Start each of its episodes from this seed.")
@parameters_option
def record_demos(
    file: Path,
    map_file: Path | None,
    env: str | None,
    actions: str | None,
    reset_seed: int | None,
    parameters: dict[str, Any],
) -> None:
    """Demonstrate by keys in this terminal.

    Each demonstration is saved in FILE when it is finished. Those that are there already are kept,
    and their environment is taken if neither --map nor --env is given.
    """
    from replication.demos.environments import GymnasiumFields
    from replication.demos.files import check_demos, load_demos, summary
    from replication.recording.terminal import record

    _catch_signals()
    if (map_file and env) or not (map_file or env or file.exists()):
        raise UserError("say where to record: --map MAP, --env ID, or a FILE that is there")
    if (parameters or actions or reset_seed is not None) and not env:
        raise UserError("-p, --actions and --reset-seed are for --env")
    with _plain_warnings():
        if env:
            names = actions.split(",") if actions else None
            more: dict[str, Any] = {"options": parameters, "reset_seed": reset_seed}
            fields = GymnasiumFields(kind="gymnasium", id=env, actions=names, **more)
            task: Any = fields.build()
            world = task if actions or reset_seed is not None else task.env
        else:
            world = _maze(map_file) if map_file else load_demos(file).environment
        try:
            demos = record(world, file)
        except KeyboardInterrupt:
            kept = f"; what was finished is in {_short(file)}" if file.exists() else ""
            _end(f"interrupted{kept}", 130)
    click.echo(f"{demos.task}: {summary(demos)}\ndemos: {_short(file)}")
    for doubt in check_demos(file):
        _say(f"warning: {doubt}")


@demos_group.command(epilog="Example: replicate demos check mine.json")
@click.argument("paths", metavar="FILE...", nargs=-1, required=True, type=FILE)
def check(paths: tuple[Path, ...]) -> None:
    """Check demonstration files, move by move.

    A warning is about a file that can be used, an error about one that cannot: exit code 1.
    """
    from replication.demos.checks import DemoError
    from replication.demos.files import check_demos

    failed = False
    for path in paths:
        try:
            doubts = check_demos(path)
        except DemoError as error:
            _say(f"error: {error}", err=True)
            failed = True
            continue
        for doubt in doubts:
            _say(f"warning: {doubt}")
        if not doubts:
            click.echo(f"{path}: ok")
    sys.exit(int(failed))


@demos_group.command(epilog="Example: replicate demos schema > schema.json")
def schema() -> None:
    """Print the JSON Schema of demonstration files."""
    from replication.demos.schema import json_schema

    click.echo(json.dumps(json_schema(), indent=2))


@contextmanager
def _plain_warnings() -> Iterator[None]:
    """Show warnings in one line each."""

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        _say(f"warning: {message}", err=True)

    with warnings.catch_warnings():
        warnings.showwarning = show
        yield


# --- choices ---------------------------------------------------------------------------------


@app.command(epilog="Example: replicate choices ALPHA")
@click.argument("id", required=False)
def choices(id: str | None) -> None:
    """List what the paper leaves open.

    Each choice has our default and, in brackets, the other values that are listed. With an ID,
    show that choice in full; a task of your own may have any number that is accepted.
    """
    from replication.paper.groups import choice_groups
    from replication.paper.register import load_choices

    entries = load_choices()
    if id is None:
        column = max(map(len, entries)) + 4
        for group, members in choice_groups().items():
            click.echo(f"{group[0].upper()}{group[1:]}")
            for entry in members:
                value = (
                    f"{entry.default} (or {entry.others})" if entry.others else f"{entry.default}"
                )
                _print_item(f"  {entry.id}", value, column)
        click.echo("\nreplicate choices ID shows one of them in full")
        return
    if id.upper() not in entries:
        raise UserError(unknown(id.upper(), entries, "choice"))
    entry = entries[id.upper()]
    names = "id place open default rule alternatives accepted field data code"
    for key in names.split():
        value = entry.others if key == "alternatives" else str(getattr(entry, key))
        if key == "accepted" and entry.range is None:
            continue
        if value:
            _print_item(f"{key}:", value, 14)


def _print_item(head: str, text: str, column: int) -> None:
    """Print a name, and from a column on a text, whose words are never broken."""
    width = shutil.get_terminal_size().columns
    options = {"break_long_words": False, "break_on_hyphens": False}
    first, *rest = textwrap.wrap(text, max(width - column, 20), **options)  # type: ignore[arg-type]
    click.echo("\n".join([head.ljust(column) + first, *(" " * column + line for line in rest)]))


# --- what the commands share -----------------------------------------------------------------


def _prepared(profile: str, out: Path | None) -> tuple[list[Any], Path]:
    """Return the runs of all notebooks, and the folder of their outputs."""
    from replication.pipeline.folders import outputs_folder
    from replication.pipeline.plan import prepare

    target = out or outputs_folder(profile)
    return prepare(_all_notebooks(), profile=profile, out=target), target


def _notebook(name: str) -> Path:
    """Find a notebook by its name or path."""
    if name.endswith(".ipynb") or len(Path(name).parts) > 1:
        path = files.resolve(name)
        if not path.exists():
            raise UserError(f"there is no notebook {name}")
        return path
    notebooks = {path.stem: path for path in _all_notebooks()}
    if name not in notebooks:
        raise UserError(unknown(name, notebooks, "notebook"))
    return notebooks[name]


def _all_notebooks() -> list[Path]:
    return sorted((files.PROJECT / "notebooks").glob("*.ipynb"))


BYTES = 80
"""Of a pair of state and action in a result, at most."""


def _check_targets(*targets: Path, source: Path | None = None, size: int = 0) -> None:
    """Refuse files that could not be written, or would take their source's place.

    Room is asked for so many bytes beyond those of most results.
    """
    for path in targets:
        if path.exists() and not path.is_file():
            raise UserError(f"{path} cannot be written: it is not a regular file; choose another")
        if source is not None and path.exists() and path.samefile(source):
            raise UserError(f"{path} would be overwritten; choose another --out")
    files.check_writable(targets[0].parent, files.ROOM + size)


def _short(path: Path) -> str:
    """Show a path relative to the working folder where it lies below it."""
    absolute = path.resolve()
    below = absolute.is_relative_to(Path.cwd())
    return os.path.relpath(absolute) if below else str(absolute)


def _catch_signals() -> None:
    """Let Ctrl-C and SIGTERM raise: kernel and workers stop, and drafts are removed."""
    last = -math.inf

    def interrupt(*_: object) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last > GRACE:
            last = now
            raise KeyboardInterrupt

    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, interrupt)
