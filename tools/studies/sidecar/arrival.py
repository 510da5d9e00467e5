"""How logs arrive in a folder."""

from __future__ import annotations

import random
import time
from pathlib import Path


def arrive(source: Path, folder: Path, chance: random.Random) -> None:
    """Write a log as robots and file servers do: at once, in pieces, or under another name first."""
    way, target, content = chance.randrange(3), folder / source.name, source.read_bytes()
    if way == 0:
        target.write_bytes(content)
    elif way == 1:
        cut = chance.randrange(len(content))
        target.write_bytes(content[:cut])
        time.sleep(0.2)
        with target.open("ab") as file:
            file.write(content[cut:])
    else:
        part = target.with_suffix(".part")
        part.write_bytes(content)
        part.rename(target)
