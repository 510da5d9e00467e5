"""Columns in the wrong order."""

from dataclasses import replace

import pytest

from acqd.dataset.build import BuildConfig, build
from acqd.dataset.column_check import check_columns, check_order
from acqd.errors import InputError, UserError
from acqd.robot.description import load_description
from acqd.robot.log import read_log
from tests.campaigns import quiet
from tests.places import ROBOT_LOGS, needs_robot_logs


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


@needs_robot_logs
def test_two_joints_exchanged_in_all_columns_are_named():
    robot = load_description("ur10e")
    swap = [2, 1, 0, 3, 4, 5]
    for name in ("ur-20_02_05-20sec_12harm", "ur-20_02_12-40sec_12harm"):
        log = read_log(ROBOT_LOGS / "ur10e" / f"{name}.csv", robot)
        check_columns(log, robot)
        with pytest.raises(InputError, match="with shoulder_pan and elbow exchanged"):
            check_columns(replace(log, q=log.q[:, swap], current=log.current[:, swap]), robot)


@needs_robot_logs
@pytest.mark.parametrize(
    ("order", "remedy"),
    [
        ([0, 2, 1, 3, 4, 5], "with shoulder_lift and elbow exchanged"),
        ([1, 2, 0, 3, 4, 5], "shoulder_pan from column 3, shoulder_lift from column 1, elbow from column 2"),
    ],
)
def test_an_order_that_single_logs_do_not_show_is_refused_for_all_of_them(order, remedy):
    robot = load_description("ur10e")
    logs = [read_log(path, robot) for path in sorted((ROBOT_LOGS / "ur10e").glob("ur-20_02*.csv"))[:5]]
    check_order(logs, robot)
    with pytest.raises(UserError, match=remedy):
        check_order([replace(log, q=log.q[:, order], current=log.current[:, order]) for log in logs], robot)
