"""Words for nothing, and sentences about one thing or many."""

from __future__ import annotations

import pytest

from bimnav._placeholders import is_placeholder
from bimnav._wording import counted


@pytest.mark.parametrize(
    "value",
    [
        *(
            "Default",
            "n/a",
            "N/A",
            "TBD",
            "Undefined",
            "Varies",
            "<Default>",
            "DD/MM/YYYY",
            "1900-12-31T23:59:59",
            "--",
        ),
        *("Sample Description", "Enter address here", "Enter address here\r\nAddress Line 2", "Project Number", "????"),
        *("Lorem ipsum dolor sit amet", "_MANUFACTURER_", " tbc ", "SerialNumber", "Serial Number"),
    ],
)
def test_words_for_nothing_are_placeholders(value):
    assert is_placeholder("SerialNumber", value)


@pytest.mark.parametrize(
    "value",
    ["GH468642", "0", "Project Alpha", "Sampled daily", "Main entrance", "IKEA", "Default Street 3", None, 0, 1.5],
)
def test_what_says_something_is_none(value):
    assert not is_placeholder("SerialNumber", value)


def test_a_sentence_agrees_with_its_number():
    message = "{n} [door fills|doors fill] no [opening|openings]."
    assert counted(message, 1) == "1 door fills no opening."
    assert counted(message, 0) == "0 doors fill no openings."
