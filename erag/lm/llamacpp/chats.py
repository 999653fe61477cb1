"""Chats to tokens: the model's template is rendered in a child process, once a shape; then messages are spliced in."""

from __future__ import annotations

from collections.abc import Sequence

from erag.core.errors import ModelError
from erag.lm.chat import Messages, Piece
from erag.lm.llamacpp.errors import ContextError
from erag.lm.llamacpp.native import NativeModel
from erag.lm.llamacpp.plan import shared
from erag.lm.llamacpp.process import ask, child_command

_SECONDS = 30
_LONGEST_TOKEN = 32  # characters a token on average at most: longer texts are refused before they are tokenised

Frame = tuple[Piece, ...]  # of a chat whose messages are their own numbers


class Chats:
    """Messages of one model as tokens. A template that hangs or swells does so in the child, which is ended."""

    def __init__(self, model: NativeModel, limit: int, command: Sequence[str] = ()) -> None:
        self._model, self._limit, self._command = model, limit, command
        self._frames: dict[tuple[str, ...], Frame] = {}

    def tokens(self, messages: Messages) -> tuple[int, ...]:
        """The prompt's tokens, at least one, up to where the assistant begins to speak.

        Raises ContextError for messages that cannot fit, ModelError when the template cannot render them.
        """
        shape = tuple(role for role, _ in messages)
        if shape not in self._frames:
            self._frames[shape] = self._frame(shape)
        texts = [text for _, text in messages]
        pieces = [piece if piece.frame else Piece(texts[int(piece.text)], frame=False) for piece in self._frames[shape]]
        self._refuse_long(sum(len(piece.text) for piece in pieces))
        tokens = tuple(self._model.vocabulary.encode_chat([piece for piece in pieces if piece.text]))
        if not tokens:
            raise ModelError("an empty prompt has nothing that an answer could follow", where=self._model.path.name)
        return tokens

    def opening(self, messages: Messages, tokens: tuple[int, ...]) -> int:
        """How many of the prompt's `tokens` come before the last message: what all prompts of its kind begin with."""
        if len(messages) < 2:
            return 0
        return shared(tokens, self.tokens((*messages[:-1], (messages[-1][0], ""))))

    def text(self, messages: Messages) -> str:
        """The prompt as text. Only for messages that are ours: what looks like a control token in them is one."""
        shape = tuple(role for role, _ in messages)
        if shape not in self._frames:
            self._frames[shape] = self._frame(shape)
        return "".join(piece.text if piece.frame else messages[int(piece.text)][1] for piece in self._frames[shape])

    def plain(self, text: str) -> tuple[int, ...]:
        """The tokens of a text on its own. Raises ContextError for one that cannot fit."""
        self._refuse_long(len(text))
        return tuple(self._model.vocabulary.encode(text))

    def _refuse_long(self, characters: int) -> None:
        if characters > self._limit * _LONGEST_TOKEN:
            raise ContextError(characters // _LONGEST_TOKEN, 0, self._limit, self._model.path.name)

    def _frame(self, shape: tuple[str, ...]) -> Frame:
        vocabulary = self._model.vocabulary
        request = {
            "do": "render",
            "template": self._model.template,
            "bos": vocabulary.token_text("bos"),
            "eos": vocabulary.token_text("eos"),
            "roles": shape,
        }
        outcome = ask(self._command or child_command(), request, _SECONDS)
        if outcome.state == "refused":
            raise ModelError(outcome.detail, where=f"chat template of {self._model.path.name}")
        if outcome.state != "ok":
            what = f"the child process that rendered it {outcome.detail}"
            raise ModelError(what, where=f"chat template of {self._model.path.name}", allowed="10 s and 1 GiB")
        return tuple(Piece(str(text), bool(frame)) for text, frame in outcome.answer["pieces"])
