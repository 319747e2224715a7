"""Check that all is fresh, lay out the sources, let Sphinx write, put the site in place."""

from __future__ import annotations

import json
import lzma
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
from replication.files import read_file, read_text, read_toml, write_file
from replication.lab.page import lab_part
from replication.pipeline.declaration import EXECUTED
from replication.pipeline.folders import exclusive, outputs_folder
from replication.pipeline.plan import Run, prepare
from replication.pipeline.run import render_text
from replication.pipeline.status import check_fresh
from replication.report.findings import held
from replication.site import extension, overview
from replication.site.choices import choices
from replication.site.findings import render_findings
from replication.site.pages import Origin, link_pages, packed, page

PLACES = ("replication/**/*.toml", "data/demos/*.json", "*.cff", ".github/workflows/*.yml")
"""Files of the project that pages link to."""

REFERENCE = "api/modules/"
"""Where Sphinx lays out the sources of the reference, one for each module."""

INDEX = "searchindex.js"
"""A file that Sphinx writes into every site, and nothing else writes."""


UNUSED = (".*", "*.map", "locales", "logo_*", "fontawesome.js", "fa-brands-*", "fa-regular-*")
"""Files that Sphinx and its theme write, but no page asks for."""


class SiteError(UserError):
    """A folder or a page that cannot be written; the message is one line."""


def build_site(
    notebooks: Sequence[Path], site: Path, *, echo: Callable[[str], object] = print
) -> Path:
    """Build the site from the results in `figures`, without executing anything.

    A page that has not changed since the last build is not written again; the site is replaced in
    one step.

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
    UserError
        If a notebook is stale or failed, Sphinx refuses a page, or the folder holds something else.
    """
    if site.exists() and any(site.iterdir()) and not (site / INDEX).exists():
        raise SiteError(f"{site} holds other files than a site; choose another folder")
    out = outputs_folder("paper")
    work = files.PROJECT / "build" / "site-work"
    with exclusive(out, echo), exclusive(work, echo):
        runs = _fresh_runs(notebooks, out)
        _stage(dict(_sources(runs, out)), work)
        echo(f"writing {len(runs)} notebooks and the pages of docs")
        _write(work)
        _replace(work / "html", site)
    return site / "index.html"


def _fresh_runs(notebooks: Sequence[Path], out: Path) -> list[Run]:
    """Return the runs behind published notebooks, their text up to date; refuse stale ones."""
    runs = prepare(notebooks, profile="paper", out=out)
    check_fresh(runs)
    for run in runs:
        render_text(run)
    return runs


def _stage(staged: Mapping[str, bytes], work: Path) -> None:
    """Lay out what Sphinx reads, in the project's own order of folders.

    What is the same as before keeps its time, or its page would be written again. Sphinx keeps the
    pages of sources that are gone, so then everything is made anew.
    """
    source = work / "source"
    there = {path.relative_to(source).as_posix() for path in source.rglob("*") if path.is_file()}
    if any(name not in staged and not _is_reference(name) for name in there):
        for part in ("source", "html", "doctrees"):
            shutil.rmtree(work / part, ignore_errors=True)
    for name, content in staged.items():
        target = source / name
        if not target.exists() or read_file(target) != content:
            write_file(target, content)


def _is_reference(name: str) -> bool:
    """Whether a source is one that Sphinx made itself, for a module that is still there."""
    module = files.PROJECT / Path(name).stem.replace(".", "/")
    return name.startswith(REFERENCE) and (module.is_dir() or module.with_suffix(".py").exists())


def _sources(runs: Sequence[Run], out: Path) -> Iterator[tuple[str, bytes]]:
    """Yield the name and the content of each file that Sphinx reads, or that pages link to."""
    for name, text in _prose(_generated(out)).items():
        yield name, text.encode()
    for pattern in PLACES:
        for path in sorted(files.PROJECT.glob(pattern)):
            yield path.relative_to(files.PROJECT).as_posix(), read_file(path)
    docs = files.PROJECT / "docs"
    for path in sorted(docs.glob("round_1/*")):
        yield path.relative_to(docs).as_posix(), read_file(path)
    for path in sorted(out.glob("[!.]*/[!.]*")):
        name = f"figures/{path.relative_to(out).as_posix()}"
        if packed(path):
            yield f"{name}.xz", lzma.compress(read_file(path), preset=9 | lzma.PRESET_EXTREME)
        elif path.suffix != ".ipynb":
            yield name, read_file(path)
    captions = read_toml(docs / "captions.toml")
    for run in runs:
        parameters = {**run.notebook.literals, **run.values}
        origin = Origin(run.name, parameters, captions.get(run.name, {}))
        shown = page(run.folder / EXECUTED, origin)
        yield f"notebooks/{run.name}.ipynb", json.dumps(shown, indent=1).encode()
        yield f"source/{run.name}.ipynb", read_file(run.notebook.path)


def _prose(generated: Mapping[str, str]) -> dict[str, str]:
    """Return the pages of docs/, each mark `<!-- site: name -->` replaced by what is generated."""
    docs = files.PROJECT / "docs"
    pages = {
        path.relative_to(docs).as_posix(): read_text(path) for path in sorted(docs.rglob("*.md"))
    }
    pages |= {name: text for name, text in generated.items() if name.endswith(".md")}
    pages = {
        name: re.sub(r"<!-- site: (\w+) -->", lambda mark: generated[mark[1]], text)
        for name, text in pages.items()
    }
    return {name: text if "/" in name else link_pages(text) for name, text in pages.items()}


def _generated(out: Path) -> dict[str, str]:
    """Return what the site computes from the published tables: parts of pages, and a page."""
    judged = read_table(out / "claims" / "verdicts.csv")
    effects = read_table(out / "sensitivity" / "effects.csv")
    holds = {id: held(effects, id) for id in judged["id"].unique()}
    findings, answer = render_findings(out)
    return {
        "answer": answer,
        "findings.md": findings,
        "verdicts": overview.verdicts(judged, holds),
        "published": overview.published(judged),
        "choices": choices(read_table(out / "sensitivity" / "shares.csv")),
        "lab": f"```{{raw}} html\n{lab_part(out)}```",
        "citation": overview.citation(read_text(files.PROJECT / "CITATION.cff")),
    }


def _write(work: Path) -> None:
    """Let Sphinx write the pages that changed; a warning is an error."""
    command = [sys.executable, "-m", "sphinx", "-b", "html", "-q", "-N", "-W", "--keep-going"]
    command += ["-c", str(files.PROJECT / "docs"), "-d", str(work / "doctrees")]
    outline, known = _outline(work / "source"), work / "outline"
    if not known.exists() or read_text(known) != outline:
        command += ["-a", "-E"]  # every page shows it at its side, and may link to new pages
        shutil.rmtree(work / "html", ignore_errors=True)  # with the pages of what is gone
    known.unlink(missing_ok=True)
    command += [str(work / "source"), str(work / "html")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        errors = done.stderr.replace(str(work / "source") + os.sep, "").strip()
        raise SiteError(f"the pages cannot be written: {errors}")
    write_file(known, outline)


def _outline(source: Path) -> str:
    """Return what is in all pages: titles, their order, modules, and what our extension adds."""
    part = re.compile(r"^# [^\n]*|^```{toctree}.*?^```", flags=re.MULTILINE | re.DOTALL)
    pages = (read_text(path) for path in sorted(source.glob("*.md")))
    titles = [title for text in pages for title in part.findall(text)]
    modules = sorted((files.PROJECT / "replication").rglob("*.py"))
    code = read_text(Path(extension.__file__))  # what it makes of a page is in no source
    return "\n".join([*titles, *(path.as_posix() for path in modules), code])


def _replace(new: Path, site: Path) -> None:
    """Put a copy of a folder in the place of another one."""
    site.parent.mkdir(parents=True, exist_ok=True)
    draft, old = (site.with_name(f".{site.name}.{kind}") for kind in ("draft", "old"))
    for left in (draft, old):
        shutil.rmtree(left, ignore_errors=True)
    shutil.copytree(new, draft, ignore=shutil.ignore_patterns(*UNUSED))
    if site.exists():
        site.replace(old)
    draft.replace(site)
    shutil.rmtree(old, ignore_errors=True)
