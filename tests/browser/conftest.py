"""The built site in a real browser: Chromium, without a network."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlparse

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

from replication.files import PROJECT
from replication.site.build import build_site
from tests.browser.screen import PATIENCE, WIDE, Open


@pytest.fixture(scope="session", autouse=True)
def chromium() -> str:
    """Find the system's Chromium; leave all tests out where there is none."""
    found = filter(None, map(shutil.which, ("chromium", "chromium-browser", "chrome")))
    path = next(found, None)
    if path is None:
        pytest.skip("the site is tested in Chromium; on Debian: apt install chromium")
    return path


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the site from the published results."""
    notebooks = sorted((PROJECT / "notebooks").glob("*.ipynb"))
    return build_site(notebooks, tmp_path_factory.mktemp("site") / "site").parent


@pytest.fixture(scope="session")
def browser(chromium: str) -> Iterator[Browser]:
    """Start the system's Chromium, without anything that it would ask of a network."""
    quiet = ["--disable-background-networking", "--disable-component-update", "--disable-sync"]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=chromium,
            args=["--no-sandbox", "--no-first-run", *quiet],
            timeout=PATIENCE,
        )
        yield browser
        browser.close()


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
        page.on("requestfailed", lambda asked: faults.extend(_failed(asked.url)))
        page.on("request", lambda asked: faults.extend([asked.url] * (not _is_local(asked.url))))
        page.goto((site / f"{name}.html").as_uri())
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert faults == []


def _failed(address: str) -> list[str]:
    """Return a fault, unless a page that is left still asked for the script of its worker."""
    return [] if address.startswith("blob:") else [f"failed: {address[:200]}"]


def _is_local(address: str) -> bool:
    return urlparse(address).scheme in ("file", "data", "blob")
