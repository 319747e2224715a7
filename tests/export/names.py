"""The notebooks whose results are published."""

from __future__ import annotations

from replication.files import PROJECT
from replication.pipeline.manifest import published_folders

NAMES = list(published_folders(PROJECT / "figures"))
