"""Times in words: which are windows of observations, which are parts of a wish."""

from __future__ import annotations

from datetime import timedelta

import numpy as np
import pytest
from aware_worlds import FIRST, SECOND, seconds, twice

from erag.aware.visits import newest, ordinal, visits
from erag.aware.when import Clock, window, without

NOW = seconds("2025-10-25T16:40:00Z")
CLOCK = Clock(NOW, visits(twice()))


def test_visits_are_found_from_gaps_in_time() -> None:
    topomap = twice()
    first, second = visits(topomap)
    assert (first.start, second.start) == (seconds(FIRST), seconds(SECOND))
    assert first.rows.tolist() == list(range(8))
    assert ordinal((first, second), 2) == "the second visit (2025-10-25)"
    assert newest(topomap) == second.end
    assert len(visits(topomap, gap=1e9)) == 1


@pytest.mark.parametrize(
    ("text", "since", "until"),
    [
        ("Which cars did you see yesterday?", "2025-10-24", "2025-10-25"),
        ("What was there yesterday evening?", "2025-10-24T17:00:00Z", "2025-10-24T22:00:00Z"),
        ("Find a bench observed on 2025-04-12", "2025-04-12", "2025-04-13"),
        ("Find a bench seen on 12 April", "2025-04-12", "2025-04-13"),
        ("What was seen since April 2025?", "2025-04", None),
        ("What did you see two days ago?", "2025-10-23", "2025-10-24"),
        ("What was there since the first visit?", SECOND, None),
        ("On the first visit, where was the tent?", FIRST, SECOND),
        ("Find a tent that is there now.", SECOND, None),
        ("Find a bench between 2025-04-01 and 2025-05-01", "2025-04-01", "2025-05-02"),
        ("What was seen in the last 3 hours?", "2025-10-25T13:40:00Z", None),
    ],
)
def test_windows_are_relative_to_the_newest_observation(text: str, since: str | None, until: str | None) -> None:
    found = window(text, CLOCK)
    assert found.since == (None if since is None else seconds(since))
    assert found.until == (None if until is None else seconds(until))


@pytest.mark.parametrize(
    ("text", "hours"),
    [
        ("Find a bench seen in the morning", (5, 12)),
        ("Show me the kiosk before 10 am", (0, 10)),
        ("What did you see between 9 and 11:30 am?", (9, 11.5)),
        ("Which people were seen after 15:30?", (15.5, 0)),
        ("What did you see at night?", (21, 5)),
    ],
)
def test_parts_of_the_day_are_hours_of_any_day(text: str, hours: tuple[float, float]) -> None:
    assert window(text, CLOCK).hours == hours


@pytest.mark.parametrize(
    "text",
    ["Something is hoisted every morning.", "Where is the delivery that arrived this morning?",
     "What shines in the evening?", "Who keeps the ball out today?", "The contracts of last year have to be somewhere.",
     "I want breakfast in the morning.",
     "My watch has stopped and I have to know whether it is noon.", "Find a bench."],
)  # fmt: skip
def test_times_that_are_part_of_a_wish_are_no_window(text: str) -> None:
    assert not window(text, CLOCK)


def test_hours_are_read_in_local_time() -> None:
    local = Clock(NOW, CLOCK.visits, timedelta(hours=2))
    assert window("Find a bench seen in the morning", local).hours == (3, 10)
    assert window("Which cars did you see yesterday?", local).since == seconds("2025-10-23T22:00:00Z")


def test_what_was_read_is_taken_out_of_the_text() -> None:
    found = window("Find a tent that is there now.", CLOCK)
    assert without("Find a tent that is there now.", found.words) == "Find a tent."
    assert without("yesterday", ("yesterday",)) == "yesterday"


def test_a_memory_of_one_visit_knows_no_visits_to_compare() -> None:
    alone = Clock(NOW, (CLOCK.visits[0],))
    assert not window("What was there since the first visit?", alone)
    assert not window("Find a tent that is there now.", Clock(NOW))
    assert np.isfinite(alone.now)
