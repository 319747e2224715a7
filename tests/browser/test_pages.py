"""The built site in a real browser, from disk: what a reader sees, on a phone and on a desk."""

from __future__ import annotations

import os
import re
import shutil
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlparse

import pytest
from axe_playwright_python.sync_playwright import Axe
from bs4 import BeautifulSoup
from playwright.sync_api import Browser, Locator, Page, sync_playwright

from replication.files import PROJECT, read_json
from replication.site.build import build_site

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "chrome"))), None)

pytestmark = pytest.mark.skipif(
    CHROMIUM is None,
    reason="the site is tested in Chromium; on Debian: apt install chromium",
)

NARROW, WIDE = {"width": 390, "height": 844}, {"width": 1600, "height": 1000}
PLAYERS = ("notebooks/open_maze", "notebooks/obstacle_maze", "notebooks/soccer")
READ = (
    *("index", "findings", "claims", "choices", "trust", "methods"),
    *("running", "demonstrations", "architecture", "api/index", "cite"),
    *PLAYERS,
    *("notebooks/method", "notebooks/claims", "notebooks/calibration", "notebooks/sensitivity"),
    *("notebooks/rounding", "round_1"),
)
"""Every page that is written for readers; others list code."""

PATIENCE = 1_200_000
"""Milliseconds after which something hangs, on however slow a machine."""

SMALL = 2_000_000
"""Bytes that a page may have, with all that it loads."""

LIGHT = 15_000_000
"""Bytes that the whole site may have."""

FOLD = 900
"""Pixels of the first screen, on which the answer stands."""


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the site from the published results."""
    notebooks = sorted((PROJECT / "notebooks").glob("*.ipynb"))
    return build_site(notebooks, tmp_path_factory.mktemp("site") / "site").parent


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Start the system's Chromium, without anything that it would ask of a network."""
    quiet = ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM,
            args=["--no-sandbox", "--no-first-run", *quiet],
            timeout=PATIENCE,
        )
        yield browser
        browser.close()


Open = Callable[..., Page]


@pytest.fixture
def open_page(browser: Browser, site: Path) -> Iterator[Open]:
    """Open a page from disk; at the end nothing may have failed or been asked of a network."""
    faults: list[str] = []
    contexts = []

    def open_page(name: str, *, size: dict[str, int] = WIDE, **options: Any) -> Page:
        contexts.append(browser.new_context(viewport=size, **options))  # type: ignore[arg-type]
        contexts[-1].set_default_timeout(PATIENCE)
        page = contexts[-1].new_page()
        page.on("console", lambda line: faults.extend([line.text] * (line.type == "error")))
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("requestfailed", lambda asked: faults.append(f"failed: {asked.url[:200]}"))
        page.on("request", lambda asked: faults.extend([asked.url] * (not _is_local(asked.url))))
        page.goto((site / f"{name}.html").as_uri())
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert faults == []


def _is_local(address: str) -> bool:
    return urlparse(address).scheme in ("file", "data", "blob")


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
            assert "code" in text, (name, text)
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
    """Its three sentences end within 900 pixels, and so do its five rows where there is room."""
    page = open_page("index", size=size)
    answer = page.locator("article ul").first
    assert answer.locator("li").count() == 3
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
        assert re.search(r"robust|fragile|not tested", text)
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


def open_player(open_page: Open, name: str) -> tuple[Page, Locator, Locator, Locator]:
    """Open a page with a player; return the page, the player, its picture and its slider."""
    page = open_page(name)
    player = page.locator(".animation").first
    return page, player, player.locator("img"), player.locator("input[type=range]")


@pytest.mark.parametrize("name", PLAYERS)
def test_a_player_works_by_mouse(open_page: Open, name: str) -> None:
    """Next, last, first, play and pause do what they say, and the picture changes with them."""
    page, player, picture, slider = open_player(open_page, name)

    def press(button: str) -> None:
        player.get_by_role("button", name=button, exact=True).click()

    first = picture.get_attribute("src")
    press("Next frame")
    assert slider.input_value() == "1"
    assert picture.get_attribute("src") != first
    press("Last frame")
    assert slider.input_value() == slider.get_attribute("max")
    press("First frame")
    assert picture.get_attribute("src") == first
    press("Play")
    page.wait_for_function("slider => slider.value >= 2", arg=slider.element_handle())
    press("Pause")
    stopped = slider.input_value()
    page.wait_for_timeout(800)
    assert slider.input_value() == stopped


@pytest.mark.parametrize("name", PLAYERS)
def test_a_player_works_by_keyboard(open_page: Open, name: str) -> None:
    """The arrow keys step on the slider, and the space bar presses a button that has the focus."""
    page, player, picture, slider = open_player(open_page, name)
    slider.focus()
    first = picture.get_attribute("src")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    assert slider.input_value() == "2"
    assert picture.get_attribute("src") != first
    page.keyboard.press("Home")
    assert picture.get_attribute("src") == first
    player.get_by_role("button", name="Play", exact=True).focus()
    page.keyboard.press("Space")
    page.wait_for_function("slider => slider.value >= 2", arg=slider.element_handle())


def test_players_show_the_methods_side_by_side(open_page: Open) -> None:
    """The words of a player name each method and how many iterations it takes."""
    text = open_page("notebooks/open_maze").locator(".animation img").first.get_attribute("alt")
    assert text is not None
    assert "side by side" in text
    for method in ("AdaBoost-IRL (R1)", "without incorrect", "with incorrect"):
        assert method in text


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
    assert not page.locator(".anim-controls").first.is_visible()


def test_no_server_is_needed(site: Path) -> None:
    """Nothing in the site names a file by an absolute path of the machine that built it."""
    here = os.fsencode(PROJECT)
    assert [
        path for path in site.rglob("*.*") if path.is_file() and here in path.read_bytes()
    ] == []
