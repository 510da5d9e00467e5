"""Frames that users hand over by mistake: refused with the remedy, or without the columns that say nothing."""

import numpy as np
import pandas as pd
import pytest

import acqd

SECONDS = np.arange(300) * 0.04


def one(number):
    frame = pd.DataFrame({"recording": f"rec{number}", "P": 40 + 5 * np.sin(SECONDS + number)})
    frame["time"] = pd.date_range("2026-01-27 08:00", periods=300, freq="40ms", tz="UTC") + pd.Timedelta(number, "h")
    for axis in range(6):
        frame[f"q{axis + 1}"] = 0.3 * np.sin(SECONDS * (1 + 0.1 * axis) + number)
    return frame


GOOD = pd.concat([one(number) for number in range(2)], ignore_index=True)


@pytest.mark.parametrize(
    ("frame", "line"),
    [
        (None, "expected a pandas.DataFrame, not NoneType"),
        ({"P": [1.0]}, "expected a pandas.DataFrame, not dict"),
        (GOOD["P"], "expected a pandas.DataFrame, not Series"),
        (GOOD.assign(time=GOOD.time.astype("int64")), "pandas.to_datetime"),
        (GOOD.iloc[::-1], "is not later than the row before; sort by time"),
        (GOOD.assign(P=40.0), "P is 40 W in all rows"),
        (GOOD.assign(P=1000 * GOOD.P), "is it in mW"),
        (GOOD.assign(q7=0.0), "has a column q7, but ur10e has 6 joints"),
        (GOOD.assign(brake=0), "12.0 s of them with closed brakes"),
        (
            GOOD.assign(**{f"current{k}": 1e4 * GOOD.q1 for k in range(1, 7)}),
            "currents in mA",
        ),
        (
            GOOD.drop(index=range(100, 130)).assign(time=GOOD.time.to_numpy()[:-30]),
            "rows are missing there",
        ),
        (GOOD.set_axis(pd.MultiIndex.from_product([GOOD.columns, ["SI"]]), axis=1), r"get_level_values\(0\)"),
        (GOOD.assign(q1=pd.arrays.SparseArray(GOOD.q1)), "cannot be read: Sparse"),
        (GOOD.assign(P=GOOD.P.map("{:.2f}".format).str.replace(".", ",")), "column P: holds text, expected numbers"),
    ],
)
def test_a_frame_of_another_kind_is_refused_with_the_remedy(tmp_path, frame, line):
    with pytest.raises(acqd.UserError, match=line):
        acqd.Dataset.from_pandas(frame, tmp_path / "ds", robot="ur10e", measured="simulated")


def fast(frame, names=tuple(f"q{axis + 1}" for axis in range(6))):
    """Angles that turn 0.2 rad in 40 ms, of which a recorder holds one for five rows in a second."""
    rows = np.arange(len(frame))
    held = np.maximum.accumulate(np.where((rows % 25 < 5) & (rows % 300 > 0), 0, rows))
    angles = {name: (0.8 * np.sin(1.2 * SECONDS[rows % 300] * (1 + 0.1 * k)))[held] for k, name in enumerate(names)}
    return frame.assign(**angles)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_an_index_of_recordings_and_times_is_read_and_held_poses_are_no_jump(tmp_path):
    frame = fast(GOOD).set_index(["recording", "time"])
    data = acqd.Dataset.from_pandas(frame, tmp_path / "ds", robot="ur10e", measured="simulated")
    assert data.recordings == ["rec0", "rec1"]


@pytest.mark.filterwarnings("error::RuntimeWarning", "ignore::UserWarning")
def test_an_arm_that_stands_still_leads_to_no_warning_of_arithmetic(tmp_path):
    still = GOOD.assign(**{f"q{axis + 1}": 0.5 for axis in range(6)})
    acqd.Dataset.from_pandas(still, tmp_path / "ds", robot="ur10e", measured="simulated")


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_columns_and_rows_that_say_nothing_are_left_out_with_a_warning(tmp_path):
    nothing = np.random.default_rng(0).random(len(GOOD)) < 0.1
    others = {f"tau{k}": -1.0 for k in range(1, 7)} | {f"current{k}": 1.0 + GOOD.q1 for k in range(1, 6)}
    frame = GOOD.assign(**others, P=GOOD.P.mask(nothing, 0.0))
    with pytest.warns(UserWarning) as warned:
        data = acqd.Dataset.from_pandas(frame, tmp_path / "ds", robot="ur10e", measured="simulated").to_pandas()
    lines = " ".join(str(warning.message) for warning in warned)
    assert not [name for name in data if name.startswith(("tau", "current"))]
    assert not data["valid"].to_numpy()[nothing].any()
    for part in ("hold 0 W", "the torque of every joint never changes", "the current of 1 of 6 joints is missing"):
        assert part in lines


def drawn(shift_s):
    """Three recordings of a UR10e whose power follows from the motion of `shift_s` earlier."""
    frames = []
    for number in range(3):
        random = np.random.default_rng(number)
        shape = random.uniform(0.3, 0.6, (2, 6)), random.uniform(0.2, 0.9, (2, 6)), random.uniform(0, 6, (2, 6))

        def motion(t, shape=shape):
            size, rate, phase = (values[:, None] for values in shape)
            angle = 2 * np.pi * rate * t[:, None] + phase
            q = (size * np.sin(angle)).sum(axis=0)
            return q, (size * 2 * np.pi * rate * np.cos(angle)).sum(axis=0)

        frame = one(number)
        q, _ = motion(SECONDS)
        _, qd = motion(SECONDS - shift_s)
        frame["P"] = 60 + (8 * np.abs(qd) + 4 * qd**2).sum(axis=1) + random.normal(0, 0.5, len(q))
        frames.append(frame.assign(**{f"q{axis + 1}": q[:, axis] for axis in range(6)}))
    return pd.concat(frames, ignore_index=True)


@pytest.mark.parametrize(("shift_s", "line"), [(0.3, "s after the motion"), (-0.2, "s before the motion"), (0, "")])
def test_power_of_another_time_than_the_motion_is_doubted(tmp_path, shift_s, line):
    with pytest.warns(UserWarning) as warned:
        acqd.Dataset.from_pandas(drawn(shift_s), tmp_path / "ds", robot="ur10e", measured="simulated")
    lines = [text for each in warned if " the motion that causes it" in (text := str(each.message))]
    assert len(lines) == bool(line) and all(line in text for text in lines)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_signals_with_more_than_two_levels_are_left_out_and_two_levels_become_0_and_1(tmp_path):
    frame = GOOD.assign(tool=np.arange(len(GOOD)) % 7, brake=5.0)
    with pytest.warns(UserWarning, match="tool holds other values than 0 and 1"):
        data = acqd.Dataset.from_pandas(frame, tmp_path / "ds", robot="ur10e", measured="simulated").to_pandas()
    assert "tool" not in data and (data["brake"] == 1.0).all()


def test_many_recordings_have_one_line_for_all(tmp_path):
    many = pd.concat([fast(one(number)) for number in range(5)])
    with pytest.warns(UserWarning) as warned:
        acqd.Dataset.from_pandas(many, tmp_path / "ds", robot="ur10e", measured="simulated")
    lines = [text for each in warned if "at its ends" in (text := str(each.message))]
    assert len(lines) == 1 and lines[0].startswith("5 of 5 recordings begin or end in motion")


def test_torques_of_another_robot_are_doubted(tmp_path):
    from acqd.robot.description import load_description
    from acqd.robot.inertia import inverse_dynamics

    frames, ur10e = [], load_description("ur10e")
    for _, rows in drawn(0).groupby("recording"):
        q = rows[[f"q{k}" for k in range(1, 7)]].to_numpy()
        qd = np.gradient(q, 0.04, axis=0)
        tau = inverse_dynamics(ur10e, q, qd, np.gradient(qd, 0.04, axis=0))
        frames.append(rows.assign(**{f"tau{k + 1}": tau[:, k] for k in range(6)}))
    for robot, doubted in (("ur10e", False), ("ur5e", True)):
        with pytest.warns(UserWarning) as warned:
            acqd.Dataset.from_pandas(pd.concat(frames), tmp_path / robot, robot=robot, measured="simulated")
        said = [text for each in warned if "are these logs of" in (text := str(each.message))]
        assert bool(said) == doubted and all("fit ur10e better than ur5e" in text for text in said)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_power_that_the_motion_does_not_explain_is_doubted(tmp_path):
    frame = drawn(0)
    mixed = frame.assign(P=frame.P.sample(frac=1, random_state=0).to_numpy())
    with pytest.warns(UserWarning, match="the motion explains .* % of the changes of the power"):
        acqd.Dataset.from_pandas(mixed, tmp_path / "ds", robot="ur10e", measured="simulated")
