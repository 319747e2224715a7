"""Check that all is fresh, lay out the sources, let Sphinx write, put the site in place."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from replication import files
from replication.errors import UserError
from replication.evidence.tables import read_table
from replication.files import write_file
from replication.pipeline.folders import exclusive, outputs_folder
from replication.pipeline.manifest import FRESH, read_manifest, read_runs
from replication.pipeline.notebook import EXECUTED
from replication.pipeline.plan import Run, prepare
from replication.pipeline.run import render_text
from replication.site import overview
from replication.site.pages import Provenance, anchor, page

PLACES = ("replication/*.toml", "data/demos/*.json", "*.cff", ".github/workflows/*.yml")
"""Files of the project that pages link to."""


INDEX = "searchindex.js"
"""A file that Sphinx writes into every site, and nothing else writes."""


class SiteError(UserError):
    """Something that the site is built from is missing or stale; the message is one line."""


def build_site(
    notebooks: Sequence[Path], site: Path, *, echo: Callable[[str], object] = print
) -> Path:
    """Build the site from the results in `figures`, without executing anything.

    Text that changed in a notebook is taken over. What a build before has written and still holds
    is not written again; the site is replaced in one step.

    Parameters
    ----------
    notebooks
        The notebooks that have a page.
    site
        Folder of the site; what is in it is replaced.
    echo
        Prints a line.

    Returns
    -------
    Path
        The first page.

    Raises
    ------
    SiteError
        If a notebook is stale or failed, Sphinx refuses a page, or the folder holds something else.
    """
    if site.exists() and any(site.iterdir()) and not (site / INDEX).exists():
        raise SiteError(f"{site} holds other files than a site; choose another folder")
    out = outputs_folder("paper")
    work = files.PROJECT / "build" / "site-work"
    with exclusive(out, echo), exclusive(work, echo):
        runs = prepare(notebooks, profile="paper", out=out)
        _check(runs)
        _stage(dict(_sources(runs, out)), work)
        echo(f"writing {len(runs)} notebooks and the pages of docs")
        _write(work)
        _replace(work / "html", site)
    return site / "index.html"


def _check(runs: Sequence[Run]) -> None:
    """Refuse what is not fresh; take over text that changed."""
    for run in runs:
        state = run.state
        if state.kind != FRESH:
            why = f": {state.why[0]}" if state.why else ""
            raise SiteError(f"{run.name} is {state.kind}{why}; first: replicate run {run.name}")
        render_text(run)


def _stage(staged: Mapping[str, bytes], work: Path) -> None:
    """Lay out what Sphinx reads, in the project's own order of folders.

    What is the same as before keeps its time, else its page would be written again. Sphinx leaves
    the pages of sources that are gone, so then everything is made anew.
    """
    source = work / "source"
    there = {path.relative_to(source).as_posix() for path in source.rglob("*") if path.is_file()}
    if there - staged.keys():
        for part in ("source", "html", "doctrees"):
            shutil.rmtree(work / part, ignore_errors=True)
    for name, content in staged.items():
        target = source / name
        if not target.exists() or target.read_bytes() != content:
            write_file(target, content)


def _sources(runs: Sequence[Run], out: Path) -> Iterator[tuple[str, bytes]]:
    docs = files.PROJECT / "docs"
    for path in sorted(docs.rglob("*.md")):
        yield path.relative_to(docs).as_posix(), path.read_bytes()
    for pattern in PLACES:
        for path in sorted(files.PROJECT.glob(pattern)):
            yield path.relative_to(files.PROJECT).as_posix(), path.read_bytes()
    yield "_generated/readme.md", _readme().encode()
    for path in sorted(out.glob("*/[!.]*")):
        if path.suffix != ".ipynb":
            yield f"figures/{path.relative_to(out).as_posix()}", path.read_bytes()
    recorded = read_runs(out)
    for run in runs:
        name = run.name
        done = recorded.get(name, {})
        came = Provenance(
            name,
            read_manifest(run.folder)["inputs"]["parameters"],
            done.get("seconds"),
            done.get("machine", ""),
        )
        shown = page(run.folder / EXECUTED, run.folder, came)
        yield f"notebooks/{name}.ipynb", json.dumps(shown, indent=1).encode()
        yield f"source/{name}.ipynb", run.notebook.path.read_bytes()
    for name, text in _overview(out).items():
        yield f"_generated/{name}.md", text.encode()


def _readme() -> str:
    """Return the README; tables and executed notebooks in files that it links to are pages here."""
    text = (files.PROJECT / "README.md").read_text(encoding="utf-8")
    text = re.sub(r"(?<=\()figures/(\w+\.ipynb)(?=\))", r"notebooks/\1", text)
    return re.sub(r"(?<=\()figures/(\w+)\.md(?=\))", lambda match: f"#{anchor(match[1])}", text)


def _overview(out: Path) -> dict[str, str]:
    judged = read_table(out / "claims.csv")
    return {
        "verdicts": overview.verdicts(judged),
        "published": overview.published(judged),
        "choices": overview.choices(read_table(out / "sensitivity_shares.csv")),
        "citation": overview.citation((files.PROJECT / "CITATION.cff").read_text("utf-8")),
    }


def _write(work: Path) -> None:
    """Let Sphinx write the pages that changed; a warning is an error."""
    command = [sys.executable, "-m", "sphinx", "-b", "html", "-q", "-N", "-W", "--keep-going"]
    command += ["-c", str(files.PROJECT / "docs"), "-d", str(work / "doctrees")]
    outline, known = _outline(work / "source"), work / "outline"
    if not known.exists() or known.read_text(encoding="utf-8") != outline:
        command.append("-a")  # the sidebar of every page shows it
    known.unlink(missing_ok=True)
    command += [str(work / "source"), str(work / "html")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        said = done.stderr.replace(str(work / "source") + os.sep, "").strip()
        raise SiteError(f"the pages cannot be written: {said}")
    write_file(known, outline)


def _outline(source: Path) -> str:
    """Return the titles of the pages and their order."""
    found = []
    for path in sorted(source.glob("*.md")):
        text = path.read_text(encoding="utf-8")
        found += re.findall(r"^# [^\n]*|^```{toctree}.*?^```", text, flags=re.MULTILINE | re.DOTALL)
    return "\n".join(found)


def _replace(new: Path, site: Path) -> None:
    """Put a copy of a folder in the place of another one."""
    site.parent.mkdir(parents=True, exist_ok=True)
    draft, old = (site.with_name(f".{site.name}.{kind}") for kind in ("draft", "old"))
    for left in (draft, old):
        shutil.rmtree(left, ignore_errors=True)
    shutil.copytree(new, draft, ignore=shutil.ignore_patterns(".*", "*.map"))
    if site.exists():
        site.replace(old)
    draft.replace(site)
    shutil.rmtree(old, ignore_errors=True)
