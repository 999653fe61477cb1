"""The cloud client over real HTTP: what it sends, what it makes of faults, what it pays."""

import base64
import json
import random
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scripted import Script, Turn, said, scripted

from erag.core.errors import BadModelOutput, ConfigError, InputError, ModelError
from erag.lm.ledger import Ledger
from erag.lm.openai.backend import OpenAI
from erag.lm.openai.calling import Caller
from erag.lm.openai.config import OpenAIRoles
from erag.lm.openai.spending import BudgetSpent, Pace
from erag.lm.roles import Group, Prompt, SelectTask
from erag.pipeline.config import validate

ASK = Prompt((("system", "Be brief."), ("user", "hello")), max_tokens=20, seed=7)
SCHEMA = {
    "type": "object",
    "properties": {
        "things": {"type": "array", "items": {"type": "string", "minLength": 3, "maxLength": 8}, "maxItems": 2}
    },
    "required": ["things"],
}


class Asked:
    """A backend on a scripted server; `waits` are the seconds it would have slept."""

    def __init__(self, script: Script, **config: Any) -> None:
        self.ledger, self.waits = Ledger(), list[float]()
        raw = {"kind": "openai", "model": "m", "base_url": script.url, "key_env": None, "parallel": 1, "timeout": 5}
        roles = validate(OpenAIRoles, {**raw, **config}, "test")
        caller = Caller(roles, self.ledger, sleep=self.waits.append, rng=random.Random(0))
        self.backend = OpenAI(roles, self.ledger, caller)


def test_a_prompt_is_sent_as_chat_and_its_tokens_counted() -> None:
    with scripted([Turn(said("hi"))]) as script:
        asked = Asked(script)
        (made,) = asked.backend.generate([ASK])
    ((path, headers, body),) = script.requests
    assert (made.text, made.truncated, made.tokens_in, made.tokens_out) == ("hi", False, 10, 5)
    assert path == "/v1/chat/completions"
    assert "authorization" not in headers
    assert body["messages"] == [{"role": "system", "content": "Be brief."}, {"role": "user", "content": "hello"}]
    assert (body["max_tokens"], body["seed"], body["temperature"]) == (20, 7, 0)
    assert (asked.ledger.tokens_in["generate"], asked.ledger.tokens_out["generate"]) == (10, 5)
    assert not asked.ledger.cost


@pytest.mark.parametrize(
    "fault",
    [
        Turn({"error": {"message": "slow down"}}, 429), Turn("oops", 500), Turn("", 503), Turn(drop=True),
        Turn(said("lost"), cut=20), Turn(json.dumps(said("lost"))[:40]), Turn("[1]"), Turn("not json", length=False),
    ],
)  # fmt: skip
def test_faults_that_pass_are_asked_again(fault: Turn) -> None:
    with scripted([fault, fault, Turn(said("at last"))]) as script:
        asked = Asked(script, backoff=1.0)
        assert asked.backend.generate([ASK])[0].text == "at last"
    assert len(script.requests) == 3
    assert asked.ledger.events["requests repeated"] == 2
    assert 0.5 <= asked.waits[0] <= 1 <= asked.waits[1] <= 2  # doubled, with jitter


def test_a_server_says_when_to_come_again() -> None:
    late = format_datetime(datetime.now(UTC) + timedelta(seconds=30), usegmt=True)
    turns = [Turn("", 429, (("Retry-After", "7"),)), Turn("", 503, (("Retry-After", late),)), Turn(said("now"))]
    with scripted(turns) as script:
        asked = Asked(script, backoff=0.5)
        asked.backend.generate([ASK])
    assert 7 <= asked.waits[0] <= 7.5
    assert 25 <= asked.waits[1] <= 30.5


def test_one_that_asks_for_too_long_a_wait_is_given_up() -> None:
    with scripted([Turn("", 429, (("Retry-After", "3600"),))]) as script:
        with pytest.raises(ModelError, match=r"asks to wait 3600 s.*up to 60 s"):
            Asked(script).backend.generate([ASK])
        assert len(script.requests) == 1


def test_it_gives_up_after_the_attempts_it_may_make() -> None:
    with scripted([Turn("", 500)]) as script:
        with pytest.raises(ModelError, match=r"status 500 \(3 attempts\)"):
            Asked(script, retries=2).backend.generate([ASK])
        assert len(script.requests) == 3


def test_a_whole_request_has_a_deadline_however_the_answer_dribbles() -> None:
    slow = scripted([Turn(said("slow"), slow=5)])
    with slow as script, pytest.raises(ModelError, match=r"no answer within 0\.2 s"):
        Asked(script, timeout=0.2, retries=0).backend.generate([ASK])


@pytest.mark.parametrize(
    ("turn", "error", "told"),
    [
        (Turn({"error": {"message": "no such model"}}, 404), ModelError, "status 404: no such model"),
        (Turn({"error": {"message": "bad", "code": "insufficient_quota"}}, 429), ModelError, "429: bad"),
        (Turn({"error": {"message": "too many tokens"}}, 400), InputError, "too many tokens"),
        (Turn({"error": {"message": "no JSON"}}, 422), BadModelOutput, "no JSON"),
        (Turn("", 302, (("Location", "http://127.0.0.1:1/"),)), ModelError, "status 302"),
        (Turn(said("", refusal="I cannot")), BadModelOutput, "refused: 'I cannot'"),
        (Turn(said("", end="content_filter")), BadModelOutput, "refused"),
        (Turn({"choices": []}), BadModelOutput, "without choices"),
        (Turn({"choices": [{"message": {"content": None}}]}), BadModelOutput, "without a text"),
    ],
)  # fmt: skip
def test_what_waiting_cannot_cure_is_told_at_once(turn: Turn, error: type[Exception], told: str) -> None:
    with scripted([turn]) as script:
        with pytest.raises(error, match=told):
            Asked(script).backend.generate([ASK])
        assert len(script.requests) == 1


def test_nobody_listening_is_one_line() -> None:
    with scripted([Turn(said("x"))]) as script:
        pass
    with pytest.raises(ModelError, match=r"127\.0\.0\.1:\d+/v1: cannot be reached"):
        Asked(script, retries=0).backend.generate([ASK])


def test_a_schema_is_sent_strictly_and_its_bounds_in_words() -> None:
    with scripted([Turn(said('{"things": ["bench"]}'))]) as script:
        (made,) = Asked(script).backend.generate([Prompt((("user", "x"),), SCHEMA)])
    (body,) = script.bodies
    sent = body["response_format"]["json_schema"]
    assert json.loads(made.text) == {"things": ["bench"]}
    assert sent["strict"] is True
    assert sent["schema"]["additionalProperties"] is False
    assert "maxLength" not in json.dumps(sent)
    assert body["messages"][0]["role"] == "system"
    assert '"maxLength": 8' in body["messages"][0]["content"]


def test_json_that_does_not_fit_is_asked_for_again_with_what_is_wrong() -> None:
    wrong = ['{"things": ["a wheelbarrow"]}', "{", '{"things": [3]}', '{"other": []}']
    with scripted([*(Turn(said(text)) for text in wrong), Turn(said('{"things": ["pond"]}'))]) as script:
        asked = Asked(script, repairs=4)
        (made,) = asked.backend.generate([Prompt((("user", "x"),), SCHEMA)])
    assert json.loads(made.text) == {"things": ["pond"]}
    told = [body["messages"][-1]["content"] for body in script.bodies[1:]]
    assert [t.split(". Answer")[0] for t in told] == [
        "That does not fit: item 1 of 'things' has 13 characters, not 3 to 8", "That does not fit: it is not JSON",
        "That does not fit: item 1 of 'things' is no text", "That does not fit: it has no 'things'",
    ]  # fmt: skip
    assert (made.tokens_in, made.tokens_out) == (50, 25)  # all five are paid


def test_json_that_never_fits_is_an_error_not_an_answer() -> None:
    with scripted([Turn(said("no"))]) as script:
        with pytest.raises(BadModelOutput, match="it is not JSON: 'no'"):
            Asked(script).backend.generate([Prompt((("user", "x"),), SCHEMA)])
        assert len(script.requests) == 2


def test_unicode_goes_both_ways() -> None:
    text = 'Ein Fluß, 川, שלום, 🌉 \u2028 \\ " \ud800'.encode("utf-8", "replace").decode()
    with scripted([Turn(said(text))]) as script:
        (made,) = Asked(script).backend.generate([Prompt((("user", text),))])
    assert made.text == text
    assert script.bodies[0]["messages"][0]["content"] == text


def test_cards_are_chosen_by_number_under_a_wrapped_schema() -> None:
    with scripted([Turn(said('{"value": 2}')), Turn(said('{"value": 1}'))]) as script:
        chosen = Asked(script).backend.select([SelectTask("sit", ("a bin", "a bench"))], 1)
    schema = script.bodies[0]["response_format"]["json_schema"]["schema"]
    assert schema["properties"]["value"] == {"enum": [1, 2], "type": "integer"}
    assert chosen == [[0]]  # listed as bench, bin and bin, bench: both votes for the bin
    assert "2. <<< a bin >>>" in script.bodies[0]["messages"][-1]["content"]


def test_scores_are_read_off_the_first_token() -> None:
    top = [{"token": "Yes", "logprob": -0.2}, {"token": " No", "logprob": -1.8}, {"token": "yes", "logprob": -5.0}]
    answer = {
        **said("Yes"),
        "choices": [{**said("Yes")["choices"][0], "logprobs": {"content": [{"top_logprobs": top}]}}],
    }
    with scripted([Turn(answer)]) as script:
        scores = Asked(script).backend.score([("sit", "a bench"), ("sit", "a bin")])
    assert scores == pytest.approx([1 / (1 + np.exp(-1.6))] * 2)
    assert len(script.requests) == 2  # Yes and No of a pair are one request
    assert (script.bodies[0]["logprobs"], script.bodies[0]["max_tokens"]) == (True, 1)


def test_a_server_without_log_probabilities_is_named() -> None:
    with scripted([Turn(said("Yes"))]) as script, pytest.raises(BadModelOutput, match="no log-probabilities"):
        Asked(script).backend.score([("sit", "a bench")])


def test_vectors_come_back_in_order_and_unit() -> None:
    data = [{"index": 1, "embedding": [0, 2]}, {"index": 0, "embedding": [3, 4]}]
    with scripted([Turn({"data": data, "usage": {"prompt_tokens": 9}})]) as script:
        asked = Asked(script, query_prefix="query: ", input_type=True)
        rows = asked.backend.embed(["a", "b"], "query")
    assert np.allclose(rows, [[0.6, 0.8], [0, 1]])
    assert script.bodies[0]["input"] == ["query: a", "query: b"]
    assert script.bodies[0]["input_type"] == "query"
    assert asked.ledger.tokens_in["embed"] == 9


@pytest.mark.parametrize(
    "data", [[], [{"index": 0, "embedding": [0, 0]}], [{"index": 1, "embedding": [1, 0]}], "x", [{"embedding": [1]}]]
)
def test_vectors_that_are_none_are_refused(data: Any) -> None:
    with scripted([Turn({"data": data})]) as script, pytest.raises(BadModelOutput, match="no vectors for 1 texts"):
        Asked(script).backend.embed(["a"], "document")


def test_images_are_sent_small_and_without_what_the_camera_wrote(tmp_path: Path) -> None:
    pillow = pytest.importorskip("PIL.Image")
    image = pillow.new("RGB", (400, 200), (200, 10, 10))
    exif = image.getexif()
    exif[0x010F] = "Secret Camera"
    image.save(tmp_path / "a.jpg", exif=exif)
    with scripted([Turn(said('{"description": "A red wall.", "objects": ["wall", "wall", " "]}'))]) as script:
        (caption,) = Asked(script, max_side=100).backend.caption([tmp_path / "a.jpg"])
    assert (caption.text, caption.objects) == ("A red wall.", ("wall",))
    url = script.bodies[0]["messages"][-1]["content"][1]["image_url"]["url"]
    sent = base64.b64decode(url.removeprefix("data:image/jpeg;base64,"))
    assert b"Secret" not in sent
    (tmp_path / "b.jpg").write_bytes(sent)
    assert pillow.open(tmp_path / "b.jpg").size == (100, 50)


def test_summaries_are_of_the_roles_own_schema() -> None:
    text = json.dumps({"summary": "A quiet park.", "name": "Park", "relationships": ["bench by pond"]})
    with scripted([Turn(said(text))]) as script:
        (summary,) = Asked(script).backend.summarise([Group(("a bench by a pond",))])
    assert (summary.name, summary.text, summary.relationships) == ("Park", "A quiet park.", ("bench by pond",))


def test_costs_are_counted_and_the_budget_is_never_passed() -> None:
    price = {"input": 1000, "output": 10_000, "currency": "EUR"}
    with scripted([Turn(said("ok", read=100, wrote=10))]) as script:
        asked = Asked(script, price=price, budget=0.7)
        asked.backend.generate([ASK])
        assert asked.ledger.cost == {"m in EUR": pytest.approx(0.2)}
        for _ in range(2):
            asked.backend.generate([ASK])
        with pytest.raises(BudgetSpent, match=r"may cost .* and 0\.6000 of 0\.7 is spent"):
            asked.backend.generate([ASK])
    assert sum(asked.ledger.cost.values()) == pytest.approx(0.6)
    assert len(script.requests) == 3
    assert any("cost of m in EUR: 0.6000" in line for line in asked.ledger.lines())


def test_an_answer_that_was_lost_may_have_been_paid_for() -> None:
    with scripted([Turn(drop=True), Turn(said("ok"))]) as script:
        asked = Asked(script, price={"input": 0, "output": 1e6})
        asked.backend.generate([ASK])
    assert asked.ledger.cost["m in USD"] == pytest.approx(20 + 5)
    assert asked.ledger.events["answers lost, counted at what they may cost"] == 1


def test_many_are_asked_at_once_and_answered_in_order() -> None:
    with scripted([Turn({"data": [{"index": 0, "embedding": [1, 0]}]}, slow=0.05)]) as script:
        asked = Asked(script, parallel=8, embed_size=1)
        rows = asked.backend.embed([f"text {i}" for i in range(8)], "document")
    assert rows.shape == (8, 2)
    assert sorted(body["input"][0] for body in script.bodies) == [f"text {i}" for i in range(8)]


def test_requests_are_spaced() -> None:
    slept: list[float] = []
    pace = Pace(60, 6000, clock=lambda: sum(slept), sleep=slept.append)
    for tokens in (10, 300, 10):
        pace.wait(tokens)
    assert slept == pytest.approx([1, 3])  # a second a request, 300 tokens take three


@pytest.mark.parametrize(
    ("raw", "told"),
    [
        ({"budget": 1}, "a budget needs a price"),
        ({"base_url": "http://example.org/v1", "key_env": "K"}, "over https only"),
        ({"base_url": "ftp://example.org"}, "an address is http"),
        ({"base_url": "https://example.org/v1?key=1"}, "without a user"),
        ({"text": {"selector": "likelihood", "scorer": "yes_no"}}, "needs likelihoods: extension"),
    ],
)
def test_configurations_that_cannot_work_are_refused(raw: dict[str, Any], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        validate(OpenAIRoles, {"model": "m", **raw}, "test")
