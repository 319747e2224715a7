"""What a forger might do to published results, and that `replicate verify` finds it.

Most of them mend the hashes in the manifests afterwards, as anybody can who has the package.
"""

from __future__ import annotations

import base64
import csv
import io
import json
import re
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from replication.evidence.tables import read_table
from replication.files import PROJECT
from replication.pipeline.inputs import data_hash, file_hash
from replication.pipeline.manifest import hashes, read_manifest, save_manifest
from replication.report.outputs import Outputs, Shown
from replication.report.readable import readable_summary, readable_verdicts
from replication.report.verdicts import verdicts
from tests.faults.checkout import Checkout

QUICK = "--profile", "quick", "--out", "out"
MAZE = "obstacle_maze"
TRIALS = "out/obstacle_maze/trials.csv"
FOREIGN = "fig99.png", ".hidden", "more/fig99.png"

Row = dict[str, str]
Forge = Callable[[Checkout], object]


def copied(source: Path, folder: Path, *names: str) -> Checkout:
    """Return a copy of the package with some folders of another project."""
    checkout = Checkout(folder)
    (checkout.folder / "notebooks" / "toy.ipynb").unlink()
    for name in names:
        shutil.copytree(source / name, checkout.folder / name, dirs_exist_ok=True)
    return checkout


@pytest.fixture(scope="module")
def published(tmp_path_factory: pytest.TempPathFactory) -> Checkout:
    """Publish a few trials of each experiment, and what follows from them."""
    project = copied(PROJECT, tmp_path_factory.mktemp("whole") / "p", "notebooks", "data")
    project.run("run", "open_maze", MAZE, "soccer", "claims", "method", *QUICK)
    return project


@pytest.fixture
def project(published: Checkout, tmp_path: Path) -> Checkout:
    """Return a copy of what was published, together with its project, but without the store."""
    names = "notebooks", "data", "replication", "out"  # the package for its compiled code
    return copied(published.folder, tmp_path / "p", *names)


@pytest.mark.long
def test_what_was_published_agrees(project: Checkout) -> None:
    """A copy that nobody has changed is proved, each trial of the mazes included."""
    done = project.run("verify", "open_maze", MAZE, "claims", "method", *QUICK, "--every", "1")
    assert done.out.endswith("\neverything agrees\n")


# --- the forger's tools ----------------------------------------------------------------------


def mend(project: Checkout) -> None:
    """Restate every hash of outputs, data and lock in the manifests."""
    out = project.folder / "out"
    for folder in [path.parent for path in out.glob("*/provenance.json")]:
        manifest = read_manifest(folder)
        inputs, names = manifest["inputs"], tuple(manifest["outputs"])
        inputs["lock"] = file_hash(project.folder / "environment.lock")
        for name in inputs["data"]:
            root = out if (out / name).exists() else project.folder
            inputs["data"][name] = data_hash(root / name)
        save_manifest(folder, manifest | {"outputs": hashes(folder, names)})


def content(name: str, change: Callable[[bytes], bytes], *, mended: bool = False) -> Forge:
    """Return a forger who changes the content of a file, and perhaps mends the hashes."""

    def forge(project: Checkout) -> None:
        path = project.folder / name
        before = path.read_bytes()
        path.write_bytes(change(before))
        assert path.read_bytes() != before
        if mended:
            mend(project)

    return forge


def text(name: str, pattern: str, new: str, *, mended: bool = False) -> Forge:
    """Return a forger who replaces the first match of a pattern in a file."""
    found = re.compile(pattern.encode())
    return content(name, lambda data: found.sub(new.encode(), data, count=1), mended=mended)


def document(name: str, change: Callable[[Any], object]) -> Forge:
    """Return a forger who changes a JSON file; unless it is a manifest, the hashes are mended."""

    def changed(data: bytes) -> bytes:
        change(value := json.loads(data))
        return (json.dumps(value, indent=1, ensure_ascii=False, sort_keys=True) + "\n").encode()

    return content(name, changed, mended=not name.endswith("provenance.json"))


def showing(folder: str, shown: Shown) -> Forge:
    """Return a forger who puts a figure or a table into the executed notebook, by its name."""
    words = shown.metadata["replication"]

    def change(notebook: Any) -> None:
        for output in [output for cell in notebook["cells"] for output in cell.get("outputs", [])]:
            old = output["metadata"].get("replication", {})
            if (old.get("kind"), old.get("name")) == (words["kind"], words["name"]):
                old.update(words)
                for kind, value in shown.data.items():
                    text = value.splitlines(keepends=True) if isinstance(value, str) else None
                    output["data"][kind] = text or base64.b64encode(value).decode()

    return document(f"out/{folder}/notebook.ipynb", change)


def flipped(data: bytes) -> bytes:
    """Flip a bit in the middle."""
    at = len(data) // 2
    return data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]


def table(name: str, change: Callable[[list[Row]], list[Row]]) -> Forge:
    """Return a forger who changes the rows of a table, as text, and mends the hashes."""

    def changed(data: bytes) -> bytes:
        rows = change(list(csv.DictReader(io.StringIO(data.decode(), newline=""))))
        file = io.StringIO(newline="")
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        return file.getvalue().encode()

    return content(name, changed, mended=True)


def last(notebook: Any, kind: str) -> Any:
    """Return the last cell of a kind."""
    return [cell for cell in notebook["cells"] if cell["cell_type"] == kind][-1]


def remake(project: Checkout, *notebooks: str) -> None:
    """Let the package itself make all else again from the forged trials of the maze.

    Only verify may give trials to a notebook, so that line is changed for the time being.
    """
    path = project.folder / "replication" / "pipeline" / "execute.py"
    genuine = path.read_text(encoding="utf-8")
    given = f'GIVEN: "{(project.folder / TRIALS).parent}",'
    assert genuine.count('GIVEN: "",') == 1
    path.write_text(genuine.replace('GIVEN: "",', given), encoding="utf-8")
    project.run("run", *notebooks, "--force", *QUICK)
    path.write_text(genuine, encoding="utf-8")


# --- forgers ---------------------------------------------------------------------------------


def pixel(project: Checkout) -> None:
    """Turn a pixel around, in file and notebook, and mend the hashes."""
    path = project.folder / "out" / "claims" / "verdicts.png"
    with Image.open(path) as opened:
        image = opened.convert("RGBA")
    image.putpixel((9, 9), (0, 0, 0, 255))
    image.save(path)
    shown = Shown({"image/png": path.read_bytes()}, kind="figure", name="verdicts")
    showing("claims", shown)(project)


def figure_redrawn(project: Checkout) -> None:
    """Move the paper's mean in a figure's table, and let the package draw it anew."""
    moved = table(f"out/{MAZE}/fig09.csv", lambda rows: [r | {"paper": "50"} for r in rows])
    moved(project)
    project.run("draw", f"{MAZE}/fig09", *QUICK)


def table_everywhere(project: Checkout) -> None:
    """Lower a mean in a table, its text and the notebook, and mend the hashes."""
    folder = project.folder / "out" / MAZE
    means = read_table(folder / "table2.csv")
    means.loc[2, ["mean", "low", "high"]] -= 3
    shown = Outputs(folder).table(means, "table2", readable=readable_summary(means))
    showing(MAZE, shown)(project)


def verdict_everywhere(project: Checkout) -> None:
    """Turn a verdict around in table, text, figure and notebook, and mend the hashes."""
    out = Outputs(project.folder / "out" / "claims")
    judged = read_table(out.folder / "verdicts.csv")
    judged.loc[judged["id"] == "SAVES-OPEN", ["verdict", "why"]] = "shown", ""
    told = out.table(judged, "verdicts", readable=readable_verdicts(judged))
    for shown in (told, out.figure(verdicts(judged), "verdicts")):
        showing("claims", shown)(project)


def hash_withheld(project: Checkout) -> None:
    """Change the executed notebook, and state no hash of it."""
    method(lambda n: n["cells"].pop())(project)
    note(lambda m: m["outputs"].pop("notebook.ipynb"))(project)


def other_inputs(manifest: Any) -> None:
    """State that all was made from something else, and that a module was not used."""
    inputs = manifest["inputs"]
    inputs["parameters"]["trials"] = 100
    inputs["data"]["data/demos/open_maze.json"] = inputs["cells"] = inputs["lock"] = "0" * 64
    del inputs["source"]["replication.irl.unified"]


def manifests_removed(project: Checkout, names: str) -> None:
    """Remove some manifests, and keep the files."""
    for path in project.folder.glob(f"out/{names}/provenance.json"):
        path.unlink()


def foreign_files(project: Checkout) -> None:
    """Add files, plain, hidden and in a folder, and a folder that no notebook publishes."""
    folder = project.folder / "out" / "open_maze"
    shutil.copytree(folder, folder.with_name("fourth_maze"))
    (folder / "more").mkdir()
    for name in FOREIGN:
        shutil.copy(folder / "fig05.png", folder / name)


def link(project: Checkout) -> None:
    """Replace a table by a link to an equal file elsewhere, which can be changed later."""
    path = project.folder / "out" / "open_maze" / "table1.csv"
    path.symlink_to(path.rename(project.folder / "aside.csv"))


def directory(project: Checkout) -> None:
    """Replace a picture by a directory of its name."""
    path = project.folder / "out" / "open_maze" / "fig05.png"
    path.unlink()
    path.mkdir()


def method_improved(project: Checkout) -> None:
    """Let a method need a fifth fewer iterations, and make all else again from its trials."""

    def improved(row: Row) -> Row:
        errors = row["errors"].split(" ")
        fewer = len(errors) // 5 if row["set"] == "hit+detour" else 0
        iterations = str(int(row["iterations"]) - fewer)
        return row | {"iterations": iterations, "errors": " ".join(errors[fewer:])}

    trials(lambda rows: [*map(improved, rows)])(project)
    remake(project, MAZE, "claims")


def other_root_seed(project: Checkout) -> None:
    """Compute the trials from another root seed, and pass them off as those of the genuine one."""
    project.run("run", MAZE, "--seed", "7", "--profile", "quick", "--out", "aside")
    shutil.copy(project.folder / "aside" / MAZE / "trials.csv", project.folder / TRIALS)
    trials(lambda rows: [row | {"seed": "4051"} for row in rows])(project)
    remake(project, MAZE)


def digests_exchanged(rows: list[Row]) -> list[Row]:
    """Exchange the digests of the first two trials."""
    first, second = ({"digest": row["digest"]} for row in rows[:2])
    return [rows[0] | second, rows[1] | first, *rows[2:]]


trials = partial(table, TRIALS)
method, claims = (partial(document, f"out/{name}/notebook.ipynb") for name in ("method", "claims"))
manifest = partial(document, "out/open_maze/provenance.json")
note = partial(document, "out/method/provenance.json")

SHOWN = "/notebook.ipynb has other bytes than its notebook gives"

# What is forged: the notebooks to verify, the forger, and what must then be said.
FORGERIES: dict[str, tuple[Any, ...]] = {
    # pictures, films, players and tables
    "picture": ("open_maze", content("out/open_maze/fig05.png", flipped), "fig05.png is changed"),
    "pixel": ("claims", pixel, "claims/verdicts.png has other", SHOWN),
    "drawing": (
        "claims",
        text("out/claims/verdicts.svg", "</svg>", "<script>1</script></svg>", mended=True),
        "claims/verdicts.svg has other bytes",
    ),
    "player": ("soccer", content("out/soccer/player.html", flipped), "player.html is changed"),
    "film": ("soccer", content("out/soccer/film.csv", flipped), "soccer/film.csv is changed"),
    "figure": (MAZE, figure_redrawn, "fig09.csv has other", "fig09.png has other"),
    "table": (MAZE, table_everywhere, "table2.csv has other", SHOWN),
    "verdict": ("claims", verdict_everywhere, "verdicts.csv has other", "verdicts.png has other"),
    # the executed notebook and the index; text and code are in no hash
    "output": ("method", method(lambda n: last(n, "code")["outputs"].clear()), SHOWN),
    "code": ("method", method(lambda n: last(n, "code").update(source=["check()"])), SHOWN),
    "prose": ("claims", claims(lambda n: last(n, "markdown").update(source=["All."])), SHOWN),
    "hidden cell": (
        "claims",
        claims(lambda n: last(n, "code")["metadata"].update(tags=["remove-cell"])),
        SHOWN,
    ),
    "alternative text": (
        "claims",
        text("out/claims/notebook.ipynb", '"alt": "faster', '"alt": "slower', mended=True),
        SHOWN,
    ),
    "injected parameter": (
        "open_maze",
        text("out/open_maze/notebook.ipynb", r'"trials = 4\\n"', r'"trials = 100\\n"'),
        "open_maze/notebook.ipynb is changed",
    ),
    "index": ("method", text("out/README.md", r"trials \d", "trials 100"), "README.md is not"),
    # the manifest
    "inputs": (
        "open_maze",
        manifest(other_inputs),
        "parameter trials has changed",
        "data/demos/open_maze.json has changed",
        "replication.irl.unified has changed",
        "the notebook's code has changed",
        "environment.lock has changed",
    ),
    "hash withheld": ("method", hash_withheld, SHOWN, "method/provenance.json has"),
    "emptied manifest": ("open_maze", manifest(dict.clear), "provenance.json cannot be read"),
    "versions": ("open_maze", manifest(lambda m: m["versions"].update(numpy="1")), "versions of"),
    "note": ("method", note(lambda m: m.update(audited=True)), "provenance.json has other"),
    "seed stated twice": (
        "open_maze",
        text("out/open_maze/provenance.json", r'("seed": \d+)', r'"seed": 7, \1'),
        "open_maze/provenance.json cannot be read",
    ),
    "no manifest": ("soccer", partial(manifests_removed, names="soccer"), "soccer/provenance.json"),
    "no manifests": (
        "open_maze claims",
        partial(manifests_removed, names="*"),
        "open_maze/provenance.json is missing",
        "claims/provenance.json is missing",
    ),
    # files and folders
    "foreign files": ("open_maze", foreign_files, "fourth_maze belongs to no notebook", *FOREIGN),
    "link": ("open_maze", link, "open_maze/table1.csv is no regular file"),
    "directory": ("open_maze", directory, "open_maze/fig05.png is no regular file"),
    # trials
    "method improved": (f"{MAZE} claims", method_improved, "row 13: its trial gives another "),
    "other root seed": (MAZE, other_root_seed, "row 1: its trial gives another digest, "),
    "measure": (
        MAZE,
        trials(lambda rows: [*rows[:-1], rows[-1] | {"early_errors": "9999"}]),
        "row 78: its trial gives another early_errors",
    ),
    "digests": (MAZE, trials(digests_exchanged), "row 1: its trial gives another digest", "row 2:"),
    "history": (
        MAZE,
        trials(lambda rows: [rows[0] | {"errors": "3" + rows[0]["errors"]}, *rows[1:]]),
        "row 1: its trial gives another errors",
    ),
    "rows removed": (MAZE, trials(lambda rows: rows[:-1]), "has 77 trials instead of 78"),
    "rows reordered": (MAZE, trials(lambda rows: rows[::-1]), "other trials than were planned"),
    "rows added": (MAZE, trials(lambda rows: [*rows, rows[-1]]), "has 79 trials instead of 78"),
    "column": (
        MAZE,
        trials(lambda rows: [row | {"audited": "1"} for row in rows]),
        "row 78: its trial gives another audited",
    ),
    "line end": (MAZE, text(TRIALS, "\n", "\r\n", mended=True), "trials.csv has other bytes"),
    "byte order mark": (MAZE, text(TRIALS, "^", "\ufeff", mended=True), "trials.csv has other"),
    # the project
    "lock": (
        "method",
        text("environment.lock", r"\nnumpy==[\d.]+", "\nnumpy==1.0", mended=True),
        "is installed; the lock pins ==1.0",
    ),
    "demonstrations": (
        MAZE,
        document(f"data/demos/{MAZE}.json", lambda file: file["incorrect"].pop()),
        f"{MAZE}/trials.csv, row",
    ),
    "task stated twice": (
        "open_maze",
        text("data/demos/open_maze.json", '"task":', '"task": "as printed", "task":'),
        "data/demos/open_maze.json has changed",
    ),
}


@pytest.mark.long
@pytest.mark.parametrize("forgery", FORGERIES)
def test_verify_finds_what_is_forged(project: Checkout, forgery: str) -> None:
    """Whatever was forged, verify ends with exit code 1 and names the file, or the trial."""
    notebooks, forge, *found = FORGERIES[forgery]
    forge(project)
    done = project.run("verify", *notebooks.split(), *QUICK, "--every", "1", code=1)
    assert all(line.startswith(("error: ", "  ")) for line in done.err.splitlines())
    assert [words for words in found if words not in done.err] == []
    if found[0].startswith("row"):  # only the recomputation of trials finds it
        assert "other bytes" not in done.err
