"""Errors for users."""

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from acqd.errors import InputError, UserError, in_our_words


def test_a_worker_tells_bad_input_as_one_line(tmp_path):
    """InputError has a constructor of its own and must survive the way back from another process."""
    error = pickle.loads(pickle.dumps(InputError("x.csv", "row 3 is empty")))
    assert isinstance(error, UserError) and str(error) == "x.csv: row 3 is empty"


@given(st.text(max_size=6000))
def test_a_message_is_one_printable_line_whatever_it_quotes(text):
    message = str(UserError(f"a.csv: {text}"))
    assert len(message.splitlines()) == 1 and message.isprintable() and len(message) < 25_000
    assert message.startswith("a.csv:")


def test_complaints_about_settings_name_no_class():
    class Inner(BaseModel):
        mode: str

    class Outer(BaseModel):
        metering: Inner
        ports: dict[str, int]

    with pytest.raises(ValidationError) as refused:
        Outer.model_validate({"metering": "synchronous", "ports": 5})
    said = {in_our_words(each["msg"]) for each in refused.value.errors()}
    assert said == {"expected a table of keys and values"}


def test_a_long_message_keeps_its_beginning_and_its_end():
    message = str(InputError("a.csv", "x" * 100_000 + "; delete it"))
    assert len(message) < 2100 and message.startswith("a.csv: x") and message.endswith("x; delete it")
    assert str(UserError("\x1b[2Jcleared")) == r"\x1b[2Jcleared"
