"""Demonstration files that were mutated: each is valid, or refused in one line."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from replication import Demos, save_demos
from replication.files import PROJECT

# Run in a process of its own, which may take 1 GB more than it has when it begins, and three hours
# of the processor.
MUTANTS = r"""
import json, pathlib, resource, sys, tempfile, warnings
import numpy as np
from replication.demos.checks import DemoError
from replication.demos.files import load_demos, save_demos
from replication.demos.model import content_hash

first, last, *sources = sys.argv[1:]
warnings.simplefilter("ignore")
originals = [pathlib.Path(source).read_bytes() for source in sources]
ODD = [None, True, False, 0, -1, 1, 7, 10**6, 10**15, 10**30, 1.5, 1e308, -0.0, float("nan"),
       float("inf"), "", "up", "correct", "x" * 100_000, "\ud800", "\n\u2028", [], {}, [[]],
       [0] * 100_000, [[0, 0]] * 1000, {"a": {}}, ["up"] * 50_000]

def places(value, found):
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, item in items:
        found.append((value, key))
        if isinstance(item, (dict, list)):
            places(item, found)
    return found

def json_mutant(content, rng):
    document = json.loads(content)
    if document["incorrect"] and rng.random() < 0.3:  # most of these are valid
        demo = document["incorrect"][int(rng.integers(len(document["incorrect"])))]
        demo.pop("states", None)
        demo["actions"] = demo["actions"][: int(rng.integers(1, 1 + len(demo["actions"])))]
        return json.dumps(document).encode()
    for _ in range(int(rng.integers(1, 3))):
        found = places(document, [])
        # by depth, or nearly all would be single states
        depth = [place for place in found if isinstance(place[0], dict)]
        if not found:
            break
        pool = depth if depth and rng.random() < 0.5 else found
        holder, key = pool[int(rng.integers(len(pool)))]
        how = int(rng.integers(7))
        if how == 0:
            del holder[key]
        elif how == 1:
            holder[key] = ODD[int(rng.integers(len(ODD)))]
        elif how == 2 and isinstance(holder, list):
            holder.insert(key, holder[int(rng.integers(len(holder)))])
        elif how == 3 and isinstance(holder[key], int):
            holder[key] += int(rng.choice([-1, 1, 2**31, 2**63]) if rng.random() < 0.5 else 1)
        elif how == 4:
            for _ in range(int(rng.choice([3, 50, 2000]))):
                holder[key] = [holder[key]]
            break  # too deep for what follows
        elif how == 5 and isinstance(holder, dict):
            holder[str(rng.choice(["states", "kind", "x", "version", "map"]))] = holder[key]
        else:
            other, there = found[int(rng.integers(len(found)))]
            try:
                holder[key] = json.loads(json.dumps(other[there]))
            except (KeyError, IndexError):  # was removed just now
                continue
    try:
        return json.dumps(document, ensure_ascii=False).encode(errors="surrogatepass")
    except RecursionError:
        return b"[" * 100_000

def byte_mutant(content, rng):
    data = bytearray(content)
    for _ in range(int(rng.integers(1, 4))):
        at, size = int(rng.integers(len(data) + 1)), int(2 ** rng.integers(0, 11))
        how = int(rng.integers(7))
        if how == 0 and data:
            data[min(at, len(data) - 1)] ^= 1 << int(rng.integers(8))
        elif how == 1:
            del data[at : at + size]
        elif how == 2:
            data[at:at] = data[at : at + size]
        elif how == 3:
            data[at:at] = rng.bytes(min(size, 16))
        elif how == 4:
            del data[at:]
        elif how == 5:
            data[at:at] = b"0123456789"[: 1 + size % 10] * (size // 4 + 1)
        else:
            data[at:at] = [b"[" * 100_000, b"9" * 5000, b"\xef\xbb\xbf", b"\0", b"\\u0000", b"-",
                           b"1e999", b"NaN"][int(rng.integers(8))]
    return bytes(data)

# what is compiled for the originals does not count as memory of the mutants
hashes = [content_hash(load_demos(source)) for source in sources]
grown = int(pathlib.Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (grown + 2**30,) * 2)
resource.setrlimit(resource.RLIMIT_CPU, (10_800, 10_800))
folder = pathlib.Path(tempfile.mkdtemp())
path, copy = folder / "mutant.json", folder / "copy.json"
count = {"same": 0, "other": 0, "refused": 0}
for number in range(int(first), int(last)):
    rng = np.random.default_rng(number)
    which = number % len(originals)
    mutate = byte_mutant if rng.random() < 0.5 else json_mutant
    path.write_bytes(mutate(originals[which], rng))
    try:
        demos = load_demos(path)
    except DemoError as error:
        text = str(error)
        assert text.startswith(f"{path}: "), (number, text)
        assert len(text.splitlines()) == 1 and text.isprintable(), (number, text)
        assert len(text) < 2000, (number, len(text))
        count["refused"] += 1
    except BaseException as error:
        raise AssertionError(f"mutant {number}") from error
    else:
        same = content_hash(demos) == hashes[which]
        count["same" if same else "other"] += 1
        for demo in demos.correct + demos.incorrect:
            if type(demos.environment).__name__ == "Maze":
                state = demos.environment.start
                for action, due in zip(demo.actions, demo.states, strict=False):
                    assert state == due, number
                    state = demos.environment.next_state[state, action]
                assert state == demo.states[-1], number
        save_demos(demos, copy)
        assert content_hash(load_demos(copy)) == content_hash(demos), number
print(json.dumps(count))
"""


def _check_mutants(folder: Path, small: Demos, bounds: list[tuple[int, int]]) -> None:
    save_demos(small, folder / "small.json")
    stored = PROJECT / "data" / "demos"
    sources = [folder / "small.json"]
    sources += [stored / f"{name}.json" for name in ("obstacle_maze", "soccer", "open_maze")]
    running = [
        subprocess.Popen(
            [sys.executable, "-c", MUTANTS, *map(str, (*bound, *sources))],
            env=os.environ | {"TMPDIR": str(folder), "OPENBLAS_NUM_THREADS": "1"},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for bound in bounds
    ]
    for process, (said, complained) in [(p, p.communicate()) for p in running]:
        assert process.returncode == 0, complained
        count = json.loads(said)
        assert min(count.values()) > 0, count


def test_mutated_demos_load_or_are_refused(tmp_path: Path, small_demos: Demos) -> None:
    """A mutated file is valid, or refused in a line that names it, within 1 GB."""
    _check_mutants(tmp_path, small_demos, [(0, 200), (200, 400)])


@pytest.mark.long
def test_ten_thousand_mutated_demos(tmp_path: Path, small_demos: Demos) -> None:
    """The same for ten thousand mutants."""
    _check_mutants(tmp_path, small_demos, [(1000, 6000), (6000, 11_000)])
