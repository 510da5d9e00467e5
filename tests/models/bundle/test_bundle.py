"""Bundles on disk, whole and damaged."""

import numpy as np
import pytest

from acqd.errors import InputError, UserError
from acqd.models.bundle.bundle import Bundle, load_bundle, save_bundle
from acqd.models.bundle.restore import open_model
from acqd.models.greybox.bundle_io import arrays_of, describe
from tests.models.motions import STEP


def test_a_bundle_brings_back_the_model_and_says_what_is_wrong_with_it(grey, tmp_path):
    data, fit = grey
    about = {"kind": "grey_box", "axes": 7, "step_s": STEP, **describe(fit)}
    save_bundle(tmp_path / "b", Bundle(about, arrays_of(fit.model)))
    _, again = open_model(tmp_path / "b")
    q = data.segments[0].q
    assert np.array_equal(again.sequence(q), fit.model.sequence(q))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["b"]
    assert {path.name for path in (tmp_path / "b").iterdir()} == {"bundle.json", "weights.safetensors"}
    save_bundle(tmp_path / "b", Bundle(about | {"name": "newer"}, arrays_of(fit.model)))
    assert load_bundle(tmp_path / "b").metadata["name"] == "newer"
    with pytest.raises(InputError, match="no bundle"):
        load_bundle(tmp_path)
    file = tmp_path / "b" / "bundle.json"
    good = file.read_text()
    for text, match in (
        (good[:-20], "damaged"),
        (good.replace('"format": 1', '"format": 9'), "another format"),
        (good.replace("grey_box", "transformer"), "unknown kind"),
        (good.replace('"axes": 7', '"axes": 6'), "hold"),
    ):
        file.write_text(text)
        with pytest.raises(InputError, match=match):
            open_model(tmp_path / "b")
    file.write_text(good)
    (tmp_path / "b" / "weights.safetensors").write_bytes(b"\x80\x04pickle")
    with pytest.raises(InputError, match="weights"):
        load_bundle(tmp_path / "b")


def test_nothing_that_is_no_bundle_is_replaced(tmp_path):
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter1.tex").write_text("x")
    for place in ("thesis", "thesis/chapter1.tex", "thesis/chapter1.tex/below"):
        with pytest.raises(UserError, match="choose another"):
            save_bundle(tmp_path / place, Bundle({}, {}))
    assert (tmp_path / "thesis" / "chapter1.tex").read_text() == "x"
