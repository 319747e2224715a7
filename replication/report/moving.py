"""Moving figures with buttons and a slider, as HTML that needs nothing from elsewhere."""

from __future__ import annotations

import base64
import hashlib
import html
import io
import re
from dataclasses import dataclass

import matplotlib as mpl
import pandas as pd
from matplotlib.animation import FuncAnimation
from PIL import Image

from replication.report.style import style

DPI = 100

ICONS = {
    "fa-minus": "&minus;",
    "fa-fast-backward": "|&lt;",
    "fa-step-backward": "&lt;",
    "fa-play fa-flip-horizontal": "&#9664;",
    "fa-pause": "||",
    "fa-play": "&#9654;",
    "fa-step-forward": "&gt;",
    "fa-fast-forward": "&gt;|",
    "fa-plus": "+",
}


@dataclass(frozen=True)
class Player:
    """A moving figure as HTML, its numbers, and what it shows in words."""

    html: str
    numbers: pd.DataFrame
    words: str


def player(animation: FuncAnimation, description: str, *, frames_a_second: int) -> str:
    """Return an animation as HTML with buttons and a slider.

    The player is Matplotlib's own, but that one loads its icons from the web, has a random id, and
    names neither picture nor slider for those who cannot see them.

    Parameters
    ----------
    animation
        What moves.
    description
        What it shows, in words.
    frames_a_second
        How fast it plays at first.
    """
    with style(), mpl.rc_context({"savefig.dpi": DPI}):
        text = animation.to_jshtml(fps=frames_a_second, default_mode="once")
    text = re.sub(r"<link[^>]*>\s*", "", text)
    text = re.sub(r'<i class="fa ([^"]*)"></i>', lambda match: ICONS[match[1]], text)
    text = re.sub(r'(?<=data:image/png;base64,)[^"]*', lambda match: _smaller(match[0]), text)
    (random_id,) = re.findall(r'<img id="_anim_img(\w+)"', text)
    content = hashlib.sha256(text.replace(random_id, "").encode()).hexdigest()
    text = text.replace('<img id="', f'<img alt="{html.escape(description)}" id="')
    text = text.replace('type="range"', 'type="range" aria-label="Frame"')
    return text.replace(random_id, content[: len(random_id)])


def _smaller(encoded: str) -> str:
    """Return a PNG, in base 64, in 256 colours: a fourth of the bytes, and it looks the same."""
    with Image.open(io.BytesIO(base64.b64decode(encoded.replace("\\\n", "")))) as frame:
        few = frame.convert("RGB").quantize(method=Image.Quantize.FASTOCTREE)
    buffer = io.BytesIO()
    few.save(buffer, format="PNG", optimize=True)
    return base64.b64encode(buffer.getvalue()).decode()
