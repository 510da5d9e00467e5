"""Columns in the wrong order."""

import pytest

from acqd.dataset.build import BuildConfig, build
from acqd.errors import UserError
from tests.campaigns import quiet


def test_mixed_up_columns_are_named(cell, tmp_path):
    made, *_ = cell
    folder = tmp_path / "logs"
    folder.mkdir()
    for path in sorted((made.out / "logs").rglob("*.log"))[:3]:
        lines = path.read_text().splitlines()
        names = lines[0].split()
        first = next(k for k, name in enumerate(names) if name.startswith("axisQMsr"))
        shift = len(names) - len(lines[1].split())  # the header may begin with a lone %
        swapped = [lines[0]]
        for line in lines[1:]:
            cells = line.split()
            one, other = first + 1 - shift, first + 3 - shift
            cells[one], cells[other] = cells[other], cells[one]
            swapped.append(" ".join(cells))
        (folder / path.name).write_text("\n".join([*swapped, ""]))
    with pytest.raises(UserError, match=r"none of 3 logs can be used; the first: .*columns in the order"):
        build(BuildConfig(f"{made.out}/power.sqlite", folder, tmp_path / "ds", "iiwa7_r800"), quiet)
    assert not (tmp_path / "ds").exists()
