"""Program files."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.motion.chain import Move
from acqd.motion.controller import Phase, SwitchTool, Wait
from acqd.motion.program_file import Program, program_text, read_program
from acqd.robot.description import load_description

ROBOT = load_description("ur10e")
_POSITION = st.lists(st.floats(-3, 3), min_size=6, max_size=6).map(np.array)
_SHARE = st.floats(0.01, 1)
_STEP = st.one_of(
    st.builds(Move, _POSITION, _SHARE, _SHARE, _SHARE), st.builds(Wait, st.floats(0, 100)),
    st.builds(SwitchTool, st.booleans(), st.floats(0, 9)), st.builds(Phase, st.sampled_from(["pick", "to the tray"])),
)  # fmt: skip


@settings(max_examples=20)
@given(start=_POSITION, steps=st.lists(_STEP, min_size=1, max_size=4))
def test_a_program_is_read_as_it_was_written(tmp_path_factory, start, steps):
    path = tmp_path_factory.getbasetemp() / "program.toml"
    path.write_text(program_text(Program(start, tuple(steps)), ROBOT, "a comment"))
    again = read_program(path, ROBOT)
    assert np.allclose(again.start, start, atol=1e-7)
    assert [type(step) for step in again.steps] == [type(step) for step in steps]
    for step, was in zip(again.steps, steps, strict=True):
        for name in was.__slots__:
            value, before = getattr(step, name), getattr(was, name)
            assert value == before if isinstance(before, str | bool) else np.allclose(value, before, atol=1e-3)
