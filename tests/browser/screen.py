"""Sizes of screens, patience, and how pages are opened: what the tests in a browser share."""

from __future__ import annotations

from collections.abc import Callable

from playwright.sync_api import Page

NARROW, WIDE = {"width": 390, "height": 844}, {"width": 1600, "height": 1000}

PATIENCE = 20_000
"""Milliseconds after which something hangs, on however slow a machine."""

Open = Callable[..., Page]
"""Opens a page of the site by its name, in a window of some `size`."""
