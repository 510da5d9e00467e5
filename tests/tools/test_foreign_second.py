"""What a study of second sessions prints of them."""

import pytest

from tools.studies.foreign import second

LENGTHS = {"third": 1 / 3, "random_third": 1 / 3, "long": 3.0}


@pytest.mark.parametrize(
    ("right", "says"),
    [
        ({"designed": 5, "random": 5, "random_third": 2}, "after 1 min, 1 times"),
        ({"designed": 5, "random": 4, "long": 5}, "after 3 min, 3 times"),
        ({"designed": 5, "random": 4, "long": 4}, "more than 3 times the minutes"),
        ({"designed": 5, "random": 4, "random_third": 5}, "after 0.33 min, 0.33 times"),
        ({"designed": 5}, "no random motion that was tried names as many"),
    ],
)
def test_the_shortest_random_motion_that_names_as_many(right, says):
    assert second.minutes_of_random(right, "designed", LENGTHS, 1.0).endswith(says)


def row(said, promised, known):
    named = {"now": "open", "designed": said}
    return {
        "world": "w", "case": "c", "compared": ["payload"], "design_cpu_s": 9.0, "design_wall_s": 12.0,
        "said": {
            name: {"answer": each, "name": None, "confidence": 0.98 if each == "right" else None}
            for name, each in named.items()
        },
        "promised": {"now": 0.1, "designed": promised}, "if_true": {"now": 0.1, "designed": known},
    }  # fmt: skip


def test_promises_are_printed_beside_the_share_that_was_right(capsys):
    second._print([row("right", 0.8, 0.9), row("open", 0.4, 0.7)], ["designed"], 1.0, 3.0)
    text = capsys.readouterr().out
    assert "promised designed: 60 % right, 80 % where the cause is known; were 50 %" in text
    assert "designed after 1 min: 1 right, 0 wrong, 1 open; mean confidence of 1 names 98 %" in text
    assert "a program: 9 s of CPU, 12 s" in text
