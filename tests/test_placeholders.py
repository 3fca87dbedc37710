"""Words for nothing, and sentences about one thing or many."""

from __future__ import annotations

import pytest

from bimnav._placeholders import is_placeholder, names_nothing
from bimnav._wording import counted
from bimnav.ifc._model import _name_of


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


@pytest.mark.parametrize(
    "name",
    ["Project Number", "Default", "Building", "My Project", "Projekt1", "Gebäude", "0001", "12370", "Untitled", ""],
)
def test_a_project_whose_name_says_nothing_is_called_after_its_file(name):
    assert names_nothing(name)
    assert _name_of(name, ("models/town_hall.ifc",)) == "town_hall"


@pytest.mark.parametrize("name", ["Town Hall", "Projekt-FZK-Haus", "FM-A-01", "BIM2PRAXIS", "House", "Haus 3"])
def test_a_project_keeps_the_name_it_was_given(name):
    assert _name_of(name, ("models/a.ifc",)) == name
