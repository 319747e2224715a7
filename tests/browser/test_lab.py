"""The maze lab in a real browser, from disk: its trials, its files, and each of its controls."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, expect

from replication import (
    METHODS,
    DemoError,
    Demos,
    Maze,
    Params,
    demonstrate,
    fit,
    load_demos,
    save_demos,
)
from replication.baselines import BaselineCondition
from replication.demos.files import check_demos, parse_demos
from replication.evidence.statistics import mean_interval
from replication.evidence.variations import random_mazes
from replication.files import PROJECT
from replication.lab.page import Lab, lab_data, lab_page
from replication.lab.tasks import FIELDS
from replication.learning import reference
from replication.trials.compute import compute
from replication.trials.results import digest
from tests.browser.computing import CORE, WASM, computed, task_of
from tests.browser.screen import NARROW, PATIENCE, WIDE, Open

FIGURES = PROJECT / "figures"

expect.set_options(timeout=PATIENCE)


@pytest.fixture
def lab(open_page: Open) -> Page:
    """Open the lab."""
    return open_page("lab")


def ended(page: Page) -> list[str]:
    """Wait until all three trials have ended, go to their end; return what stands under them."""
    page.wait_for_function("document.getElementById('story').dataset.rate > 0")
    page.locator("#at").press("End")
    captions = page.locator("#panels figcaption")
    for caption in captions.all():
        expect(caption).to_contain_text("d = 0 after")
    return captions.all_inner_texts()


def verdict(page: Page) -> str:
    """Return what the page says of the drawing."""
    return page.locator("#verdict").inner_text()


def give(page: Page, content: str | bytes, name: str = "given.json") -> None:
    """Open a file in the lab."""
    data = content.encode() if isinstance(content, str) else content
    file: Any = {"name": name, "mimeType": "application/json", "buffer": data}
    expect(page.locator("#lab")).to_be_visible()
    page.locator("#import").set_input_files(file)
    expect(page.locator("#verdict")).to_have_attribute("data-file", name)


def parse(text: str) -> Demos:
    """Return the demonstrations of a file's text."""
    return parse_demos(text.encode())


def words_of(values: list[int]) -> str:
    """Return a mean with its interval as the page shows it."""
    low, high = mean_interval(np.array(values, float))
    text = f"{np.mean(values):.2f} [{low:.2f}, {high:.2f}]"
    return text.replace("-", "\N{MINUS SIGN}")


# --- the same bits ---------------------------------------------------------------------------


def random_call(rng: np.random.Generator) -> dict[str, Any]:
    """Return arguments of the learner: any table, values that often tie, zeros of both signs."""
    n = int(rng.integers(1, 12))
    few = [[0.0, -0.0], [0.0, -0.0, 1.0, 1.0 + 1e-12], rng.normal(size=9).tolist()]
    values = few[rng.integers(3)]
    share = [0.0, 0.1, 0.5, 0.9, 1.0]
    return {
        "moves": rng.integers(0, n, 4 * n).tolist(),
        "weights": rng.choice(values, 4 * n).tolist(),
        "q": rng.choice(values, 4 * n).tolist(),
        "words": rng.integers(0, 2**32, 8).tolist(),
        "start": int(rng.integers(n)),
        "goal": int(rng.integers(n)),
        "episodes": int(rng.integers(1, 20)),
        "horizon": int(rng.integers(1, 30)),
        "beta": rng.choice(share),
        "gamma": rng.choice(share),
        "epsilon": rng.choice(share),
        "tie_tolerance": rng.choice([0.0, 1e-12, 1e-3, 0.5]),
        "ties": rng.choice(["random", "first"]),
    }


def learned(call: dict[str, Any]) -> list[Any]:
    """Return what the reference learns: the bits of Q, the stream, and both counts."""
    rows = {name: np.reshape(call[name], (-1, 4)).tolist() for name in ("moves", "weights", "q")}
    words = np.array(call["words"], np.uint32).view(np.uint64)
    names = ("start", "goal", "episodes", "horizon", "beta", "gamma", "epsilon")
    q, stream, steps, collisions = reference.learn(
        rows["moves"],
        rows["weights"],
        rows["q"],
        words.tolist(),
        **{name: call[name] for name in names},
        tolerance=call["tie_tolerance"],
        random_ties=call["ties"] == "random",
    )
    bits = np.array(q).view(np.uint32).ravel().tolist()
    return [bits, np.array(stream, np.uint64).view(np.uint32).tolist(), steps, collisions]


def test_both_learners_are_the_reference(lab: Page) -> None:
    """On 500 tables with any parameters, WebAssembly and JavaScript give the reference's bits."""
    rng = np.random.default_rng(np.random.SeedSequence(17))
    calls = [random_call(rng) for _ in range(500)]
    found = lab.evaluate(
        f"""([wasm, calls]) => {{
          const core = {CORE};
          const fast = core.compileLearner(Uint8Array.from(atob(wasm), c => c.charCodeAt(0)));
          return [fast, core.learnPlainly].map(learn => calls.map(call => {{
            const moves = Int32Array.from(call.moves);
            const world = {{ ...call, moves, states: moves.length / 4 }};
            const q = Float64Array.from(call.q), words = Uint32Array.from(call.words);
            const counts = learn(world, Float64Array.from(call.weights), q, words, call);
            return [[...new Uint32Array(q.buffer)], [...words], ...counts];
          }}));
        }}""",
        [WASM, calls],
    )
    expected = [learned(call) for call in calls]
    assert found[0] == expected
    assert found[1] == expected


def test_trials_have_the_bits_of_python(lab: Page, small_demos: Demos) -> None:
    """On random mazes, with any of the choices, a trial has the digest of Python's.

    In some the untrained agent's error is as large as the threshold, and so small enough.
    """
    rng = np.random.default_rng(np.random.SeedSequence(18))
    mazes = random_mazes(
        Maze.from_text("S" + "." * 8 + "\n" + ("." * 9 + "\n") * 7 + "." * 8 + "G"),
        obstacles=10,
        moves=16,
        seed=np.random.SeedSequence(3),
    )
    jobs, expected = [], []
    for k in range(24):
        demos = small_demos if k % 4 == 0 else demonstrate("any", next(mazes))
        choices: dict[str, Any] = {
            "incorrect": "all",
            "episodes": 100,
            "max_iterations": 30,
            "f_index": str(rng.choice(["printed", "updated", "at-once"])),
            "alpha": float(rng.choice([0.0, 0.1, 0.9])),
            "f_start": float(rng.choice([0.1, 1.0])),
            "q_start": str(rng.choice(["kept", "reset"])),
            "ties": str(rng.choice(["random", "first"])),
            "w_start": str(rng.choice(["zero", "uniform-0.001"])),
            "tie_tolerance": float(rng.choice([0.0, 1e-9])),
        }
        method, root = (
            str(rng.choice(["adaboost", "unified", "unified-incorrect"])),
            int(rng.integers(2**40)),
        )
        for _ in range(2):
            params = Params.of(**choices)
            _, trial = compute(BaselineCondition(demos, method, params), k, root, traced=False)
            if k % 8 == 0:
                choices["threshold"] = trial.errors[0]
        expected.append([trial.iterations, trial.steps, digest(trial)])
        values = {name: params.values()[name] for name in FIELDS}
        jobs.append(
            {"task": task_of(demos), "method": method, "params": values, "root": root, "trial": k}
        )
    assert computed(lab, jobs, plainly=True) == expected


def published() -> list[tuple[str, int, str]]:
    """Return fifty published trials, drawn at random: their condition, number and digest."""
    rng = np.random.default_rng(np.random.SeedSequence(50))
    groups = lab_data(FIGURES)["published"]["groups"]
    tables = [FIGURES / task / "trials.csv" for task in ("open_maze", "obstacle_maze")]
    trials = pd.concat([pd.read_csv(table, keep_default_na=False) for table in tables])
    names = ["task", "method", "reading", "set", "trial"]
    digests = trials.set_index(names)["digest"]
    drawn = []
    for group in rng.choice(groups, 50):
        trial = int(rng.integers(group["trials"]))
        key = *(group[name] for name in names[:-1]), trial
        drawn.append((group["title"], trial, digests[key]))
    return drawn


def test_published_trials_are_computed_again(lab: Page) -> None:
    """Fifty published trials, drawn at random, have their whole digests in the page."""
    trials = published()
    for title, trial, _ in trials:
        lab.locator("#condition").select_option(label=title)
        lab.locator("#number").fill(str(trial))
        lab.locator("#check").click()
    items = lab.locator("#checks li")
    expect(items.filter(has_text="computing")).to_have_count(0)
    assert all("✓" in text for text in items.all_inner_texts())
    shown = [item.get_attribute("data-digest") for item in items.all()]
    assert shown == [digits for _, _, digits in trials]


def test_twenty_at_random_agree(lab: Page) -> None:
    """One click checks twenty trials, and all agree."""
    lab.locator("#check-many").click()
    expect(lab.locator("#checks li").filter(has_text="as published")).to_have_count(20)


def test_a_mismatch_is_shown(open_page: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    """If a trial had other bits than those published, the page would say so."""
    monkeypatch.setattr("replication.lab.published._only", lambda seeds: int(seeds.iloc[0]) + 1)
    lab = open_page("index")
    lab.set_content(lab_page(FIGURES))
    lab.locator("#check").click()
    expect(lab.locator("#checks li")).to_contain_text("is published")
    expect(lab.locator("#checks li")).to_contain_text("✗")


# --- files -----------------------------------------------------------------------------------


def test_what_is_saved_is_what_python_saves(lab: Page, tmp_path: Path) -> None:
    """A stored file that is opened and saved again has its own bytes."""
    for name in ("open_maze", "obstacle_maze"):
        source = PROJECT / "data" / "demos" / f"{name}.json"
        give(lab, source.read_bytes(), source.name)
        with lab.expect_download() as saved:
            lab.locator("#export").click()
        saved.value.save_as(tmp_path / "saved.json")
        save_demos(load_demos(source), tmp_path / "python.json")
        assert saved.value.suggested_filename == f"{name.replace('_', '-')}.json"
        assert (tmp_path / "saved.json").read_bytes() == (tmp_path / "python.json").read_bytes()


def drawn(page: Page, folder: Path) -> Path:
    """Draw a maze of 5 x 4 and drive in it, by the keyboard; return the saved file."""
    page.locator("#clear").click()
    for name, size in (("rows", "4"), ("columns", "5")):
        page.locator(f"#{name}").fill(size)
        page.locator(f"#{name}").press("Tab")
    where = page.locator("#map")
    for tool, cell in (("start", [3, 0]), ("goal", [0, 4]), ("wall", [1, 2])):
        page.locator(f"[name=lab-tool][value={tool}]").check()
        where.focus()
        for key in ["ArrowUp"] * 4 + ["ArrowLeft"] * 5 + ["ArrowDown"] * cell[0]:
            where.press(key)
        for key in ["ArrowRight"] * cell[1] + [" "]:
            where.press(key)
    page.locator("[name=lab-tool][value=correct]").check()
    where.focus()
    for key in ["ArrowUp"] * 3 + ["ArrowRight"] * 4:
        where.press(key)
    page.locator("[name=lab-tool][value=mistake]").check()
    where.focus()
    for key in ["ArrowUp", "ArrowUp", "ArrowDown", "ArrowDown", "ArrowDown", "Enter"]:
        where.press(key)
    page.locator("#task").fill("my maze")
    page.locator("#task").press("Tab")
    with page.expect_download() as saved:
        page.locator("#export").click()
    saved.value.save_as(folder / "mine.json")
    return folder / "mine.json"


def test_a_drawing_is_learned_from_with_the_same_bits(lab: Page, tmp_path: Path) -> None:
    """What is drawn and driven by keys passes `demos check`; `learn` learns as the page does."""
    file = drawn(lab, tmp_path)
    assert check_demos(file) == []
    demos = load_demos(file)
    assert demos.environment == Maze.from_text("....G\n..#..\n.....\nS....")
    assert demos.task == "my-maze"
    assert [demo.name for demo in demos.correct + demos.incorrect] == ["correct", "opposite-1"]
    assert demos.incorrect[0].actions.tolist() == [0, 0, 1, 1, 1]
    lab.locator("#switches summary").click()
    lab.locator("#choice-f_index").select_option('"at-once"')
    captions = ended(lab)
    for method, caption in zip(METHODS, captions, strict=True):
        result = fit(demos, method=method, f_index="at-once")
        assert f"d = 0 after {result.iterations} iterations" in caption
    command = [sys.executable, "-m", "replication", "learn", str(file), "--out", str(tmp_path)]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert f"converged after {fit(demos).iterations} iterations" in told


MAPS = [
    "SG#",
    "S#G",
    "SxG",
    "S..",
    "SS.G",
    "G.",
    "",
    "S.\n.G.",
    "S.G\n" * 41,
    "S" + "." * 40 + "G",
]


def document(**changes: Any) -> dict[str, Any]:
    """Return a small file with some fields replaced."""
    demo = {"name": "straight", "actions": ["right", "right"], "states": [[0, 0], [0, 1], [0, 2]]}
    mistake = {"name": "bump", "kind": "hit", "actions": ["up", "right", "right"]}
    whole = {
        "format": "replication-demos",
        "version": 1,
        "task": "corridor",
        "environment": {"kind": "maze", "map": ["S.G", "..."]},
        "correct": [demo],
        "incorrect": [mistake],
    }
    return whole | changes


def demo_of(**changes: Any) -> dict[str, Any]:
    """Return a file whose correct demonstration has some fields replaced."""
    (demo,) = document()["correct"]
    return document(correct=[demo | changes])


VALUES: list[Any] = [None, 7, [], {}, "<b>x</b>"]
BROKEN: list[Any] = [
    *(document(environment={"kind": "maze", "map": text.splitlines()}) for text in MAPS),
    *(
        document(**{field: value})
        for field in document()
        for value in VALUES
        if not (field == "incorrect" and value == [])
    ),
    *(
        demo_of(actions=value)
        for value in ([], ["right"], ["right", "fly"], ["right"] * 3, "right")
    ),
    *(demo_of(states=value) for value in ([[0, 0]], [[0, 1]] * 3, [[0, 0], [0, 1], [1, 2]], 5)),
    *(demo_of(name=value) for value in ("", "a\nb", 5, "x" * 101)),
    demo_of(colour="red"),
    document(extra=1),
    document(environment={"kind": "soccer"}),
    document(environment={"kind": "maze", "map": ["S.G", "..."], "start": [1, 1]}),
    document(incorrect=[{"name": "straight", "kind": "hit", "actions": ["up"]}]),
    document(incorrect=[{"name": "x", "kind": "hit", "actions": ["right"] * 3}]),
    *(
        document(incorrect=[{"name": "x", "kind": kind, "actions": ["up"]}])
        for kind in ("all", "none", "correct", "<script>")
    ),
    document(incorrect=[{"name": "x", "actions": ["up"]}]),
]


def test_broken_files_are_refused(lab: Page, tmp_path: Path) -> None:
    """What Python refuses, the page refuses in one line, and nothing that is drawn changes."""
    give(lab, json.dumps(document()), "good.json")
    assert verdict(lab) == "These demonstrations can be used."
    shown = lab.locator("#total").inner_text(), lab.locator("#task").input_value()
    for number, broken in enumerate(BROKEN):
        file = tmp_path / f"{number}.json"
        file.write_text(json.dumps(broken))
        with pytest.raises(DemoError):
            load_demos(file)
        give(lab, file.read_bytes(), file.name)
        text = verdict(lab)
        assert text.startswith(file.name), broken
        assert "\n" not in text
        assert len(text) < 400
        assert (lab.locator("#total").inner_text(), lab.locator("#task").input_value()) == shown


HOSTILE = {
    "deep": b"[" * 100_000,
    "binary": bytes(range(256)) * 40,
    "empty": b"",
    "prototype": json.dumps(document()).replace('"task"', '"__proto__": {"x": 1}, "task"').encode(),
    "script": json.dumps(demo_of(name="<img src=x onerror=alert(1)>", actions=["up"])).encode(),
}


def test_what_is_too_much_for_the_page_is_refused(lab: Page) -> None:
    """It takes one correct demonstration, 200 mistakes and 2000 moves; Python takes more."""
    up = {"kind": "hit", "actions": ["up"]}
    second = {"name": "second", "actions": ["right", "right"]}
    for most, words in (
        (document(correct=[*document()["correct"], second]), "the file has 2; keep one"),
        (document(incorrect=[{"name": "x", **up, "actions": ["up"] * 2001}]), "at most 2000 texts"),
        (document(incorrect=[{"name": f"x{k}", **up} for k in range(201)]), "at most 200 demos"),
    ):
        parse(json.dumps(most))
        give(lab, json.dumps(most), "most.json")
        assert words in verdict(lab)
    give(lab, "\ufeff" + json.dumps(document()), "marked.json")
    assert verdict(lab) == "These demonstrations can be used."


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_refused(lab: Page, name: str) -> None:
    """A file that is huge, deep, binary or full of script is refused, and nothing of it runs."""
    before = lab.locator("#total").inner_text()
    lab.on("dialog", lambda dialog: pytest.fail(dialog.message))
    give(lab, HOSTILE[name], f"{name}.json")
    expect(lab.locator("#verdict")).to_contain_text(f"{name}.json: ")
    assert lab.locator("#total").inner_text() == before
    assert lab.locator("img[src=x]").count() == 0


def test_a_huge_file_is_not_even_read(lab: Page, tmp_path: Path) -> None:
    """A file of 50 MB is refused by its size."""
    lab.evaluate("() => { Blob.prototype.text = () => Promise.reject(new Error('read')); }")
    (tmp_path / "huge.json").write_bytes(b"[" * 50_000_000)
    lab.locator("#import").set_input_files(tmp_path / "huge.json")
    expect(lab.locator("#verdict")).to_have_text("huge.json: is larger than 1 MB; drop some demos")


def test_names_are_shown_as_text(lab: Page) -> None:
    """A name that looks like HTML is a name."""
    give(lab, json.dumps(demo_of(name="<b id=bold>x</b>")))
    lab.locator("#all summary").click()
    expect(lab.locator("#demos")).to_contain_text("<b id=bold>x</b>")
    assert lab.locator("#bold").count() == 0


def test_the_page_doubts_what_python_doubts(lab: Page, tmp_path: Path) -> None:
    """What `demos check` warns of stands beside the map, in its words."""
    idle = [{"name": "same", "kind": "hit", "actions": ["right"]}]
    round_ = {"name": "round", "actions": ["down", "up", "right", "right"]}
    doubtful = [
        document(incorrect=idle),
        document(incorrect=[*idle, idle[0] | {"name": "b"}]),
        document(correct=[round_], incorrect=idle),
    ]
    for number, some in enumerate(doubtful):
        file = tmp_path / f"{number}.json"
        file.write_text(json.dumps(some))
        warnings = [text.removeprefix(f"{file}: ") for text in check_demos(file)]
        give(lab, file.read_bytes(), file.name)
        assert warnings
        assert verdict(lab) == "; ".join(warnings)


# --- watching --------------------------------------------------------------------------------


def test_it_plays_before_anybody_touches_it(lab: Page) -> None:
    """It starts on the paper's open maze, and runs to the end of all three trials by itself."""
    assert lab.locator("#maze option:checked").inner_text() == "the paper's open maze"
    expect(lab.locator("#play")).to_have_text("Play")  # where it has come to an end
    captions = lab.locator("#panels figcaption").all_inner_texts()
    demos = load_demos(PROJECT / "data" / "demos" / "open_maze.json")
    for method, caption in zip(METHODS, captions, strict=True):
        assert f"d = 0 after {fit(demos, method=method, params=Params()).iterations}" in caption
    expect(lab.locator("#story")).to_contain_text("Here the mistakes")


def test_it_is_fast(lab: Page) -> None:
    """More than 20 million steps a second: enough for a trial in some seconds."""
    ended(lab)
    rates = []
    for seed in range(1, 6):
        lab.locator("#seed").evaluate("(box, seed) => { box.value = seed; box.onchange(); }", seed)
        ended(lab)
        rates.append(float(lab.locator("#story").get_attribute("data-rate") or 0))
    assert max(rates) > 20e6


@pytest.mark.parametrize("by", ["mouse", "keyboard", "touch"])
def test_iterations_can_be_stepped_through(open_page: Open, by: str) -> None:
    """Play, pause, step, the slider and the jump to where they part, by any means."""
    touch = by == "touch"
    lab = open_page("lab", **({"size": NARROW, "has_touch": True} if touch else {"size": WIDE}))

    def press(name: str) -> None:
        button = lab.locator(f"#{name}")
        if by == "keyboard":
            button.press("Enter")
        else:
            (button.tap if touch else button.click)()

    ended(lab)
    lab.locator("#at").press("Home")
    expect(lab.locator("#count")).to_contain_text("iteration 0 of")
    press("step")
    expect(lab.locator("#count")).to_contain_text("iteration 1 of")
    lab.locator("#at").press("ArrowRight")
    expect(lab.locator("#count")).to_contain_text("iteration 2 of")
    press("play")
    expect(lab.locator("#play")).to_have_text("Pause")
    expect(lab.locator("#count")).not_to_contain_text("iteration 2 of")
    press("play")
    expect(lab.locator("#play")).to_have_text("Play")
    press("part")
    where = lab.locator("#story").inner_text().split("at iteration ")[1].split(".")[0]
    expect(lab.locator("#count")).to_contain_text(f"iteration {where} of")


def test_switches_begin_again_and_go_back(lab: Page) -> None:
    """Each switch restarts the trials with its value; the button restores what is registered."""
    first = ended(lab)
    lab.locator("#switches summary").click()
    lab.locator("#choice-q_start").select_option('"reset"')
    assert ended(lab) != first
    opposite = lab.locator("#kinds").get_by_label("opposite")
    opposite.check()
    ended(lab)
    lab.locator("#defaults").click()
    assert ended(lab) == first
    assert not opposite.is_checked()


# --- drawing ---------------------------------------------------------------------------------


def middle(page: Page, row: int, column: int) -> tuple[float, float]:
    """Return where a cell of the map is on the screen."""
    where = page.locator("#map")
    where.scroll_into_view_if_needed()
    box = where.bounding_box()
    assert box is not None
    rows, columns = (int(page.locator(f"#{name}").input_value()) for name in ("rows", "columns"))
    return box["x"] + (column + 0.5) * box["width"] / columns, box["y"] + (row + 0.5) * box[
        "height"
    ] / rows


def empty(page: Page) -> None:
    """Open a file with a map of 2 x 3 and one demonstration."""
    give(page, json.dumps(document(incorrect=[])), "start.json")


def test_a_pointer_draws_and_drives(lab: Page) -> None:
    """A stroke lays walls, a click moves the goal, dragging drives; undo goes back."""
    empty(lab)
    lab.locator("[name=lab-tool][value=mistake]").check()
    lab.mouse.move(*middle(lab, 0, 0))
    lab.mouse.down()
    lab.mouse.move(*middle(lab, 1, 0))
    lab.mouse.move(*middle(lab, 1, 2))
    lab.mouse.up()
    expect(lab.locator("#where")).to_contain_text("row 1, column 2 after 3 moves")
    lab.locator("#undo").click()
    expect(lab.locator("#where")).to_contain_text("row 1, column 1 after 2 moves")
    lab.locator("#kind").fill("detour")
    lab.locator("#finish").click()
    expect(lab.locator("#total")).to_have_text("1 correct demo, 1 incorrect")
    lab.locator("[name=lab-tool][value=wall]").check()
    lab.mouse.click(*middle(lab, 0, 1))
    expect(lab.locator("#verdict")).to_contain_text("misses the goal")
    assert lab.locator("#run").is_disabled()
    assert lab.locator("#export").is_disabled()
    lab.locator("#undo").click()
    assert lab.locator("#run").is_enabled()
    expect(lab.locator("#verdict")).to_have_text("These demonstrations can be used.")
    lab.locator("[name=lab-tool][value=goal]").check()
    lab.mouse.click(*middle(lab, 1, 2))
    expect(lab.locator("#verdict")).to_contain_text("misses the goal [1,2]")


def test_a_finger_drives(open_page: Open) -> None:
    """On a telephone the arrows beside the map drive, and the demonstration ends at the goal."""
    lab = open_page("lab", size=NARROW, has_touch=True)
    empty(lab)
    lab.locator("[name=lab-tool][value=correct]").check()
    for name in ("Down", "Right", "Right", "Up"):
        lab.get_by_role("button", name=name, exact=True).tap()
    expect(lab.locator("#total")).to_have_text("1 correct demo, 0 incorrect")
    lab.locator("#run").tap()
    expect(lab.locator("#meter")).to_contain_text("60 of 60 trials")
    assert lab.evaluate("document.documentElement.scrollWidth") <= NARROW["width"]
    lab.locator("#all summary").tap()
    expect(lab.locator("#demos")).to_contain_text("correct, 4 moves")
    lab.get_by_role("button", name="Remove correct").tap()
    expect(lab.locator("#verdict")).to_contain_text("there is no correct demo")


def test_a_changed_maze_loses_its_name(lab: Page) -> None:
    """Whoever changes the paper's maze has one of their own, with another name."""
    assert lab.locator("#task").input_value() == "open-maze"
    lab.locator("[name=lab-tool][value=wall]").check()
    lab.mouse.click(*middle(lab, 0, 0))
    assert lab.locator("#task").input_value() == "mine"
    assert lab.locator("#maze option:checked").inner_text() == "another one"
    lab.mouse.click(*middle(lab, 0, 1))
    lab.locator("#undo").click()
    assert lab.locator("#task").input_value() == "mine"
    lab.locator("#undo").click()
    assert lab.locator("#task").input_value() == "open-maze"


def test_a_map_grows_by_free_cells(lab: Page) -> None:
    """Another size keeps what fits, its new cells are free, and demonstrations begin anew."""
    empty(lab)
    for name, size in (("rows", "3"), ("columns", "5")):
        lab.locator(f"#{name}").fill(size)
        lab.locator(f"#{name}").press("Tab")
        expect(lab.locator("#verdict")).to_contain_text("there is no correct demo")
    lab.locator("#columns").fill("2")
    lab.locator("#columns").press("Tab")
    expect(lab.locator("#verdict")).to_contain_text("the map has no goal")


def test_a_kind_that_no_file_may_have_is_refused(lab: Page) -> None:
    """The kind of a mistake is checked before it is kept."""
    empty(lab)
    lab.locator("[name=lab-tool][value=mistake]").check()
    lab.get_by_role("button", name="Down", exact=True).click()
    lab.locator("#kind").fill("All of it")
    lab.locator("#finish").click()
    expect(lab.locator("#verdict")).to_contain_text("use small letters")
    expect(lab.locator("#total")).to_have_text("1 correct demo, 0 incorrect")


# --- many trials -----------------------------------------------------------------------------


def test_many_trials_have_the_interval_of_python(lab: Page) -> None:
    """Mean and interval are those of `mean_interval`, of the trials that Python computes."""
    give(lab, json.dumps(document()), "small.json")
    lab.locator("#trials").fill("12")
    lab.locator("#run").click()
    expect(lab.locator("#meter")).to_contain_text("36 of 36 trials")
    expect(lab.locator("#run")).to_have_text("Run")
    cells = lab.locator("#summary tbody tr").all()
    demos = parse(json.dumps(document()))
    found = {}
    for method, row in zip(METHODS, cells, strict=False):
        condition = BaselineCondition(demos, method, Params.of(incorrect="all"))
        found[method] = [compute(condition, k, 0, traced=False)[1].iterations for k in range(12)]
        assert row.locator("td").nth(1).inner_text() == words_of(found[method])
    saved = np.subtract(found["unified"], found["unified-incorrect"])
    assert cells[3].locator("td").nth(1).inner_text() == words_of(saved.tolist())


def test_many_trials_can_be_stopped(lab: Page) -> None:
    """Stop ends them at once, and another run begins from nothing."""
    lab.locator("#trials").fill("100")
    lab.locator("#run").click()
    expect(lab.locator("#run")).to_have_text("Stop")
    lab.locator("#run").click()
    expect(lab.locator("#run")).to_have_text("Run")
    counted = lab.locator("#meter").inner_text()
    give(lab, json.dumps(document()), "small.json")
    assert lab.locator("#meter").inner_text() == counted
    lab.locator("#trials").fill("10")
    lab.locator("#run").click()
    expect(lab.locator("#meter")).to_contain_text("30 of 30 trials")


@pytest.mark.long
def test_many_trials_do_not_fill_the_memory(lab: Page) -> None:
    """However long trials run, the memory that the page holds stays as it is."""
    give(lab, json.dumps(document()), "small.json")
    lab.locator("#trials").fill("100")

    def held() -> float:
        lab.locator("#run").click()
        expect(lab.locator("#run")).to_have_text("Stop")
        expect(lab.locator("#run")).to_have_text("Run")
        session = lab.context.new_cdp_session(lab)
        session.send("HeapProfiler.collectGarbage")
        return float(lab.evaluate("performance.memory.usedJSHeapSize"))

    first = held()
    later = [held() for _ in range(60)]
    assert max(later[-10:]) < 1.5 * first + 2e6


# --- the page itself -------------------------------------------------------------------------


def test_it_is_one_small_file_for_itself(open_page: Open, tmp_path: Path) -> None:
    """Written by the command, it weighs under 200 kB, asks for no other file, and works."""
    file = tmp_path / "lab.html"
    command = [sys.executable, "-m", "replication", "lab", "--out", str(file)]
    subprocess.run(command, check=True, capture_output=True)
    assert file.stat().st_size < 200_000
    page = open_page("index")
    page.goto(file.as_uri())
    ended(page)
    assert page.evaluate("performance.getEntriesByType('resource').length") <= 1  # its worker
    violations = Axe().run(page, options={"preload": False}).response["violations"]
    assert [fault["id"] for fault in violations if fault["impact"] in ("serious", "critical")] == []


def test_it_works_without_webassembly(open_page: Open) -> None:
    """Where there is no WebAssembly, the plain learner gives the same trials."""
    page = open_page("lab")
    page.set_content(lab_page().replace("WebAssembly.Module(bytes)", "WebAssembly.None(bytes)"))
    give(page, json.dumps(document()), "small.json")
    captions = ended(page)
    demos = parse(json.dumps(document()))
    for method, caption in zip(METHODS, captions, strict=True):
        assert f"d = 0 after {fit(demos, method=method).iterations} iterations" in caption


def test_it_works_in_a_notebook(open_page: Open) -> None:
    """In a frame, as a cell shows it, the trials run, and there is nothing published to check."""
    page = open_page("index")
    page.set_content(Lab()._repr_html_())
    frame = page.frame_locator("iframe")
    expect(frame.locator("#part")).to_be_enabled()
    expect(frame.locator("#published")).to_be_hidden()
