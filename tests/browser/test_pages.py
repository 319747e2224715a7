"""The built site in a real browser, from disk: what a reader sees, on a phone and on a desk."""

from __future__ import annotations

import os
import re
import tomllib
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

import pytest
from axe_playwright_python.sync_playwright import Axe
from bs4 import BeautifulSoup
from playwright.sync_api import Browser, Locator, Page

from replication.files import PROJECT, read_json
from tests.browser.screen import NARROW, PATIENCE, WIDE, Open

PLAYERS = ("notebooks/open_maze", "notebooks/obstacle_maze", "notebooks/soccer")
READ = (
    *("index", "findings", "claims", "choices", "trust", "methods"),
    *("running", "demonstrations", "task", "gymnasium", "record", "reward"),
    *("architecture", "api/index", "cite", "lab"),
    *PLAYERS,
    *("notebooks/method", "notebooks/claims", "notebooks/calibration", "notebooks/sensitivity"),
    *("notebooks/beyond", "notebooks/rounding", "round_1"),
)
"""Every page that is written for readers; others list code."""

SMALL = 2_000_000
"""Bytes that a page may have, with all that it loads."""

LIGHT = 15_000_000
"""Bytes that the whole site may have."""

FOLD = 900
"""Pixels of the first screen, on which the answer stands."""


def test_every_page_for_readers_is_tested(site: Path) -> None:
    """No page is written that the tests below do not open, but for lists of code."""
    made = {path.relative_to(site).with_suffix("").as_posix() for path in site.rglob("*.html")}
    code = ("_", "genindex", "py-modindex", "search", "api/modules/")
    lists = {name for name in made if name.startswith(code)}
    assert made - lists == set(READ)


@pytest.mark.parametrize("name", READ)
def test_pages_load_and_fit(open_page: Open, name: str) -> None:
    """A page loads from disk; a phone need not scroll sideways; pictures are there, with words."""
    for size in (NARROW, WIDE):
        page = open_page(name, size=size)
        assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
    images = page.evaluate(
        "Promise.all([...document.images].map(image => image.decode().then(() => [image.alt,"
        " image.naturalWidth], () => [image.alt, 0])))"
    )
    assert all(len(alt) > 20 and width > 0 for alt, width in images), images
    assert page.evaluate(
        "[...document.querySelectorAll('main svg.interval')].every(plot =>"
        " plot.getAttribute('aria-label'))"
    )


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("name", READ)
def test_pages_are_accessible(open_page: Open, name: str, scheme: str) -> None:
    """The checks of axe-core find no serious fault, in light and in dark."""
    page = open_page(name, color_scheme=scheme)
    violations = Axe().run(page, options={"preload": False}).response["violations"]
    grave = [
        (fault["id"], fault["nodes"][0]["html"])
        for fault in violations
        if fault["impact"] in ("serious", "critical")
    ]
    assert grave == []


def test_the_colour_scheme_is_the_readers(open_page: Open) -> None:
    """The page's ground is light or dark, as the reader's system is."""

    def ground(scheme: str) -> int:
        page = open_page("index", color_scheme=scheme)
        colour = page.evaluate("getComputedStyle(document.body).backgroundColor")
        return sum(map(int, colour[4:-1].split(",")))

    assert ground("dark") < 200 < 600 < ground("light")


def test_links_lead_somewhere(site: Path) -> None:
    """Every link of every page leads to a file of the site and, in a page, to an existing place."""
    places = {
        path: {tag["id"] for tag in soup(path).find_all(id=True)} for path in site.rglob("*.html")
    }
    lost = []
    for path in places:
        for link in soup(path).find_all("a", href=True):
            target = urlparse(str(link["href"]))
            if target.scheme:
                continue
            file = (path.parent / unquote(target.path)).resolve() if target.path else path
            known = places.get(file)
            if not file.exists() or (target.fragment and known and target.fragment not in known):
                lost.append((path.name, link["href"]))
    assert lost == []


def test_code_that_is_named_is_linked(site: Path) -> None:
    """Every function that a page names leads to its entry in the reference."""
    for name in set(READ) - {"api/index"}:
        for code in soup(site / f"{name}.html").select("code.py"):
            assert code.find_parent("a") is not None, (name, code.get_text())


def soup(path: Path) -> BeautifulSoup:
    """Parse a page."""
    return BeautifulSoup(path.read_text(encoding="utf-8"), "html.parser")


def test_every_figure_is_traced(site: Path) -> None:
    """Data and code are under each figure; once a page, the notebook, and the seed of its run."""
    for name in (*PLAYERS, "notebooks/claims", "notebooks/sensitivity"):
        main = soup(site / f"{name}.html").select_one("main article")
        assert main is not None
        figures = main.select("figure")
        assert figures
        for figure in figures:
            text = figure.get_text(" ", strip=True)
            assert "CSV" in text, (name, text)
            (code,) = (link for link in figure.select("a") if link.get_text() == "code")
            file = str(code["href"]).partition("#")[0]
            assert (site / name).parent.joinpath(file).resolve().is_file(), (name, file)
        assert main.get_text().count("Root seed") == (name != "notebooks/claims")
        assert len(main.select("a[href$='.ipynb']")) == 1


def test_every_figure_has_a_caption_for_readers() -> None:
    """Each published figure has a caption that begins with its number or what it is about."""
    captions = tomllib.loads((PROJECT / "docs" / "captions.toml").read_text(encoding="utf-8"))
    for notebook in (PROJECT / "figures").glob("*/notebook.ipynb"):
        known = [
            output["metadata"].get("replication", {})
            for cell in read_json(notebook)["cells"]
            for output in cell.get("outputs", [])
            if "metadata" in output
        ]
        figures = {each["name"] for each in known if each.get("kind") == "figure"}
        assert figures == set(captions.get(notebook.parent.name, {})), notebook
        for caption in captions.get(notebook.parent.name, {}).values():
            assert caption.startswith("**")


# --- the first screen ------------------------------------------------------------------------


@pytest.mark.parametrize("size", [NARROW, WIDE], ids=["narrow", "wide"])
def test_the_answer_stands_on_the_first_screen(open_page: Open, size: dict[str, int]) -> None:
    """Its four sentences end within 900 pixels, and so do its five rows where there is room."""
    page = open_page("index", size=size)
    answer = page.locator("article ul").first
    assert answer.locator("li").count() == 4
    table = page.locator("article table").first
    assert table.locator("tbody tr").count() == 5
    last = answer if size == NARROW else table
    box = last.bounding_box()
    assert box is not None
    assert box["y"] + box["height"] < FOLD


def test_no_verdict_looks_final(open_page: Open) -> None:
    """Each verdict of the home page has a word for how far it hangs on choices, and its bar."""
    page = open_page("index")
    tables = page.locator("article table.cards")
    assert tables.count() == 2
    for cell in tables.locator("tbody td[data-label='Holds with other choices']").all():
        text = cell.inner_text()
        assert re.search(r"robust|not contradicted|fragile|not tested", text)
        assert cell.locator(".bar").count() == ("not tested" not in text)


def test_a_link_that_is_shared_shows_something(site: Path) -> None:
    """Titles differ; each page has a description, and where it has a picture shares that."""
    titles = []
    for name in READ:
        page = soup(site / f"{name}.html")
        assert page.title is not None
        titles.append(page.title.get_text(strip=True))
        description = page.select_one("meta[name=description]")
        assert description is not None, name
        assert len(str(description["content"])) > 20
        picture = page.select_one("meta[property='og:image']")
        if picture is not None:
            assert ((site / f"{name}.html").parent / str(picture["content"])).exists()
    assert len(set(titles)) == len(titles)
    assert soup(site / "index.html").select_one("meta[property='og:image']") is not None


# --- text, formulas, search ------------------------------------------------------------------


@pytest.mark.parametrize("name", READ)
def test_no_text_is_too_small(open_page: Open, name: str) -> None:
    """All text of an article has at least 11 pixels, on a phone too; indices may be smaller."""
    page = open_page(name, size=NARROW)
    small = page.evaluate(
        "[...document.querySelectorAll('article *')].filter(node =>"
        " [...node.childNodes].some(text => text.nodeType === 3 && text.data.trim())"
        " && !node.closest('math, sub, sup, .animation, script, style')"
        " && parseFloat(getComputedStyle(node).fontSize) < 11).map(node => node.outerHTML)"
    )
    assert small == []


def test_formulas_have_their_font(open_page: Open) -> None:
    """The shipped font is loaded, a brace grows with its cases, and no formula is cut above."""
    page = open_page("methods")
    page.evaluate("document.fonts.ready")
    assert page.evaluate("document.fonts.check('16px \"Report Math\"', 'x')")
    brace, plain = (
        page.evaluate(
            "text => [...document.querySelectorAll('math mo')].filter(mo => mo.textContent.trim()"
            " === text).map(mo => mo.getBoundingClientRect().height).sort((a, b) => b - a)[0]",
            text,
        )
        for text in ("{", "=")
    )
    assert brace > 2 * plain
    assert page.evaluate(
        "[...document.querySelectorAll('.formula')].every(box =>"
        " box.scrollHeight <= box.clientHeight)"
    )


def test_a_formula_looks_the_same_without_the_readers_fonts(open_page: Open) -> None:
    """As a picture it is another one if the shipped font is taken away: none else is used."""
    page = open_page("methods")
    page.evaluate("document.fonts.ready")
    formula = page.locator(".formula").first
    shipped = formula.screenshot()
    assert formula.screenshot() == shipped
    page.add_style_tag(content="math { font-family: monospace !important; }")
    assert formula.screenshot() != shipped


def test_the_search_works_from_disk(open_page: Open) -> None:
    """Results have a part of their page, and what is written for readers comes first."""
    page = open_page("search")
    page.goto(f"{page.url}?q=calibration")
    results = page.locator("#search-results ul.search > li")
    page.wait_for_function("document.querySelectorAll('#search-results .context').length > 3")
    links = [
        str(link) for link in results.locator("> a").evaluate_all("all => all.map(a => a.href)")
    ]
    code = ["/api/" in link for link in links]
    assert code == sorted(code)
    assert not code[0]
    assert any(
        "calibration" in text.lower() for text in results.locator(".context").all_inner_texts()
    )


# --- a telephone -----------------------------------------------------------------------------


def test_wide_things_fit_a_telephone(open_page: Open) -> None:
    """Verdicts are cards without a rest to the right; a figure is wide, and opens in full."""
    page = open_page("index", size=NARROW)
    for box in page.locator(".table-box:has(.cards)").all():
        assert box.evaluate("box => box.scrollWidth <= box.clientWidth")
    figure = page.locator("article figure").first
    assert figure.locator("img").evaluate("image => image.clientWidth") >= 600
    target = figure.locator("a:has(img)").evaluate("link => link.href")
    assert target == figure.locator("img").evaluate("image => image.src")


def test_the_index_fits_a_telephone(open_page: Open) -> None:
    """The list of all names of the code needs no scrolling sideways."""
    page = open_page("genindex", size=NARROW)
    assert page.evaluate("document.documentElement.scrollWidth") <= NARROW["width"]


# --- the players -----------------------------------------------------------------------------

SEEN = (
    "player => [...player.querySelectorAll('.panels svg')].map(one => one.innerHTML +"
    " one.getAttribute('aria-label')).join()"
)
"""What the panels of a player show."""


def open_player(open_page: Open, name: str, **options: Any) -> tuple[Page, Locator, Locator]:
    """Open a page with a player; return the page, the player and its slider."""
    page = open_page(name, **options)
    player = page.locator(".replay").first
    return page, player, player.locator("input[type=range]")


def press(player: Locator, button: str, *, tap: bool = False) -> None:
    """Press a button of a player."""
    found = player.get_by_role("button", name=button, exact=True)
    if tap:
        found.tap()
    else:
        found.click()


def wait_for(slider: Locator, condition: str) -> None:
    """Wait until the value of a slider meets a condition."""
    slider.page.wait_for_function(
        f"slider => slider.value {condition}", arg=slider.element_handle()
    )


@pytest.mark.parametrize("name", PLAYERS)
@pytest.mark.parametrize("by", ["mouse", "touch"])
def test_a_player_works_by_pointer(open_page: Open, name: str, by: str) -> None:
    """First, next, last, play and pause do what they say, and the picture changes with them."""
    touch = by == "touch"
    options: dict[str, Any] = {"size": NARROW, "has_touch": True} if touch else {}
    page, player, slider = open_player(open_page, name, **options)
    press(player, "First frame", tap=touch)
    first = player.evaluate(SEEN)
    press(player, "Next frame", tap=touch)
    assert slider.input_value() == "1"
    assert player.evaluate(SEEN) != first
    press(player, "Last frame", tap=touch)
    assert slider.input_value() == slider.get_attribute("max")
    press(player, "First frame", tap=touch)
    assert player.evaluate(SEEN) == first
    press(player, "Play", tap=touch)
    wait_for(slider, ">= 2")
    press(player, "Pause", tap=touch)
    stopped = slider.input_value()
    page.wait_for_timeout(800)
    assert slider.input_value() == stopped


@pytest.mark.parametrize("name", PLAYERS)
def test_a_player_works_by_keyboard(open_page: Open, name: str) -> None:
    """Arrow keys, Home and End step; the space bar plays and pauses, and does not scroll."""
    page, player, slider = open_player(open_page, name)
    slider.focus()
    page.keyboard.press("Home")
    first = player.evaluate(SEEN)
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    assert slider.input_value() == "2"
    assert player.evaluate(SEEN) != first
    page.keyboard.press("ArrowLeft")
    assert slider.input_value() == "1"
    page.keyboard.press("End")
    assert slider.input_value() == slider.get_attribute("max")
    page.keyboard.press("Home")
    assert player.evaluate(SEEN) == first
    for focus in (slider, player):
        focus.focus()
        page.keyboard.press("Home")
        before = page.evaluate("scrollY")
        page.keyboard.press("Space")
        wait_for(slider, ">= 1")
        page.keyboard.press("Space")
        assert player.get_by_role("button", name="Play", exact=True).count() == 1
        assert page.evaluate("scrollY") == before


def test_playing_again_begins_at_the_start(open_page: Open) -> None:
    """A player waits until it is asked to play, stops at the end, and then plays from the start."""
    page, player, slider = open_player(open_page, "notebooks/soccer")
    page.wait_for_timeout(800)
    last = slider.get_attribute("max")
    assert slider.input_value() == last
    press(player, "Play")
    wait_for(slider, "<= 3")
    player.get_by_role("button", name="Play", exact=True).wait_for()
    assert slider.input_value() == last
    press(player, "Play")
    wait_for(slider, "<= 3")
    assert player.get_by_role("button", name="Pause", exact=True).count() == 1


def test_what_a_slider_shows_is_spoken(open_page: Open) -> None:
    """The slider says iteration and error of both sides, and each panel its own."""
    page, player, slider = open_player(open_page, "notebooks/open_maze")
    slider.focus()
    page.keyboard.press("Home")
    for _ in range(7):
        page.keyboard.press("ArrowRight")
    spoken = slider.get_attribute("aria-valuetext") or ""
    side = r"incorrect: d = [\d.]+, \d+ moves"
    assert re.fullmatch(f"iteration 7, Without {side}; With {side}", spoken)
    for panel in player.locator(".panels svg").all():
        assert (panel.get_attribute("aria-label") or "nothing") in spoken


@pytest.mark.parametrize("name", PLAYERS)
def test_readings_and_trials_can_be_chosen(open_page: Open, name: str) -> None:
    """Each reading and trial says which trial it is; in most the two sides end differently."""
    _, player, _ = open_player(open_page, name)
    readings, parts = player.locator("fieldset").all()
    seen, differ = set(), 0
    for reading in readings.get_by_role("radio").all():
        reading.check()
        for part in parts.get_by_role("radio").all():
            part.check()
            seen.add(player.locator("p").inner_text())
            one, other = player.locator(".status").all_inner_texts()
            differ += one != other
    assert len(seen) == 9
    assert differ > 4


def test_a_point_of_the_curve_can_be_chosen(open_page: Open) -> None:
    """A click on the curve of errors goes to the iteration there."""
    _, player, slider = open_player(open_page, "notebooks/open_maze")
    chart = player.locator(".chart")
    box = chart.bounding_box()
    assert box is not None
    chart.click(position={"x": box["width"] / 2, "y": 20})
    middle = int(slider.get_attribute("max") or 0) / 2
    assert abs(int(slider.input_value()) - middle) <= 1


def test_a_film_lets_an_episode_be_chosen(open_page: Open) -> None:
    """The film has an option for each episode, and each is as long as it is."""
    film = open_page("notebooks/soccer").locator(".replay").nth(1)
    slider = film.locator("input[type=range]")
    lengths = set()
    for option in film.get_by_role("radio").all():
        option.check()
        press(film, "Last frame")
        lengths.add(slider.get_attribute("max"))
        spoken = slider.get_attribute("aria-valuetext") or ""
        assert re.match(r"decision \d+, .*decisions$", spoken)
    assert len(lengths) == 3


@pytest.mark.parametrize("motion", ["reduce", "no-preference"])
def test_nothing_glides_for_whoever_asks_for_less_motion(open_page: Open, motion: str) -> None:
    """While a film plays its robots glide, unless the reader's system asks for less motion."""
    film = open_page("notebooks/soccer", reduced_motion=motion).locator(".replay").nth(1)
    press(film, "Play")
    glide = film.locator(".mover").first.evaluate("one => getComputedStyle(one).transitionDuration")
    assert (glide == "0s") == (motion == "reduce")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_players_work_as_files_and_several_on_a_page(
    browser: Browser, tmp_path: Path, scheme: str
) -> None:
    """A player opens from disk in the reader's colours; copies on one page do not clash."""
    page = browser.new_page(viewport=NARROW, color_scheme=scheme)  # type: ignore[arg-type]
    faults: list[str] = []
    page.on("pageerror", lambda error: faults.append(str(error)))
    figures = PROJECT / "figures"
    files = [figures / name / "player.html" for name in ("open_maze", "obstacle_maze", "soccer")]
    files.append(figures / "soccer" / "film.html")
    for file in files:
        assert file.stat().st_size < 200_000
        page.goto(file.as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= NARROW["width"]
        ink = page.evaluate("getComputedStyle(document.querySelector('.replay')).color")
        assert ink == {"light": "rgb(0, 0, 0)", "dark": "rgb(255, 255, 255)"}[scheme]
    text = "".join(file.read_text(encoding="utf-8") for file in (*files, files[0]))
    together = tmp_path / "together.html"
    together.write_text(f"<!doctype html><title>several</title><body>{text}", encoding="utf-8")
    page.goto(together.as_uri())
    players = page.locator(".replay").all()
    sliders = [player.locator("input[type=range]") for player in players]
    assert len(players) == sum(slider.count() for slider in sliders) == 5
    players[0].get_by_role("radio").nth(2).check()
    assert players[4].get_by_role("radio").nth(0).is_checked()
    press(players[0], "First frame")
    assert [slider.input_value() == "0" for slider in sliders] == [True, *[False] * 4]
    page.close()
    assert faults == []


# --- tables ----------------------------------------------------------------------------------


def column(page: Page, number: int) -> list[str]:
    """Return a column of the first table."""
    cells: list[str] = page.evaluate(
        "n => [...document.querySelectorAll('table.sortable')[0].tBodies[0].rows].map(row =>"
        " row.cells[n].dataset.sort ?? row.cells[n].textContent.trim())",
        number,
    )
    return cells


@pytest.mark.parametrize("by", ["mouse", "keyboard"])
def test_tables_sort(open_page: Open, by: str) -> None:
    """A click on a head, or Enter, sorts by its numbers, down and then up."""
    page = open_page("notebooks/open_maze")
    head = page.locator("table.sortable").first.locator("th", has_text="iterations")
    number = head.evaluate("cell => cell.cellIndex")
    before = [float(cell) for cell in column(page, number)]
    assert before != sorted(before)
    down = sorted(before, reverse=True)
    for order, direction in ((down, "descending"), (down[::-1], "ascending")):
        if by == "mouse":
            head.click()
        else:
            head.focus()
            page.keyboard.press("Enter")
        assert head.get_attribute("aria-sort") == direction
        for _ in range(PATIENCE // 100):  # the rows move a moment after the click
            if [float(cell) for cell in column(page, number)] == order:
                break
            page.wait_for_timeout(100)
        assert [float(cell) for cell in column(page, number)] == order


def test_a_table_without_a_file_can_be_downloaded(open_page: Open) -> None:
    """The link below a table of the prose downloads it as CSV."""
    page = open_page("choices")
    with page.expect_download() as download:
        page.locator("a.table-csv").first.click()
    text = Path(download.value.path()).read_text(encoding="utf-8")
    assert text.startswith('"Choice","What hangs on it')
    assert text.count("\n") == page.locator("table").first.locator("tr").count()


# --- weight and paper ------------------------------------------------------------------------


def test_the_site_is_light(open_page: Open, site: Path) -> None:
    """The whole site weighs under 15 MB, and each page under 2 MB with all that it loads."""
    assert sum(path.stat().st_size for path in site.rglob("*") if path.is_file()) < LIGHT
    for name in READ:
        page = open_page(name)
        assert page.locator("script[src*=fontawesome]").count() == 0
        loaded = page.evaluate("performance.getEntriesByType('resource').map(entry => entry.name)")
        files = {Path(unquote(urlparse(url).path)) for url in loaded if url.startswith("file:")}
        size = sum(file.stat().st_size for file in files | {site / f"{name}.html"})
        assert size < SMALL, f"{name} weighs {size} bytes"


def test_pages_can_be_printed(open_page: Open) -> None:
    """A page becomes a PDF of some pages, in which nothing that only works on a screen is left."""
    page = open_page("notebooks/open_maze")
    assert len(page.pdf()) > 100_000
    page.emulate_media(media="print")
    assert not page.locator(".replay .controls").first.is_visible()


def test_no_server_is_needed(site: Path) -> None:
    """Nothing in the site names a file by an absolute path of the machine that built it."""
    here = os.fsencode(PROJECT)
    assert [
        path for path in site.rglob("*.*") if path.is_file() and here in path.read_bytes()
    ] == []
