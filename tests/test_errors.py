"""Messages are one line of a length that can be read, whatever a damaged file says in them."""

import pytest

from femupdate.errors import FemupdateError


@pytest.mark.parametrize("mark", ["\n", "\r\n", "\t\x00\x1b", "\u2028", "   "])
def test_one_line_without_marks_that_a_terminal_obeys(mark):
    assert str(FemupdateError(f"a{mark}b; mend it{mark}")) == "a b; mend it"


def test_what_is_long_is_shortened_and_the_mend_kept():
    text = str(FemupdateError(f"the value is {'9' * 5000}; correct it"))
    assert len(text) < 350
    assert text.startswith("the value is 999")
    assert " ... " in text
    assert text.endswith("; correct it")
    text = str(FemupdateError("one of " + "a, " * 5000 + "; correct it"))
    assert len(text) <= 2000
    assert text.endswith("; correct it")
