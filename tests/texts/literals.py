"""Finding words in the sources of the participant's pages that no translation can reach.

A literal that looks like words for people has to stand in `t`, `tn` or `tc`. What only looks so (classes, drawings,
addresses) is known by where it stands.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

import tree_sitter_javascript
from tree_sitter import Language, Node, Parser

TRANSLATED = {"t", "tn", "tc"}
NO_WORDS_IN = {
    *("Error", "TypeError", "console.warn", "console.error"),
    *("querySelector", "querySelectorAll", "closest", "matches", "matchMedia"),
}
"""Calls whose arguments are for developers, or for the browser."""
NO_WORDS = {
    *("class", "className", "type", "role", "name", "for", "d", "viewBox", "transform", "stroke", "fill", "testid"),
    *("autocomplete", "autocapitalize", "inputmode", "enterkeyhint", "kind", "rel", "href", "points", "href", "action"),
    *("font-family", "text-anchor", "stroke-dasharray", "stroke-linecap", "state", "step", "method", "block", "cache"),
}
"""Keys and attributes whose values nobody reads."""
WORDS = re.compile(r"[A-Za-zÀ-ž]+[,.:;!?…]? [A-Za-zÀ-ž]|[A-Z][a-z]{2,}|[a-z]{2,}[.!?…]$")
"""Two words, a capital letter at the beginning of one, or a full stop."""
CODE = re.compile(
    r"^(?:[A-Z][a-z]+[A-Z]\w*|Arrow\w+|Page(?:Up|Down)|Key\w?|Digit.*|Numpad\w*|Enter|Space|Escape|Tab|Shift|Control|Meta|Alt|AltGraph|ContextMenu|Process|Unidentified|Dead)$"
    r"|^[MmLlHhVvCcQqAaZz0-9 .,-]+$"
    r"|^(?:https?|wss?|blob|data):|^\.*/\S*$"
    r"|^Content-Type$|^Shared Autonomy Lab$"
)
"""Names of keys and events, paths of drawings, addresses, and the lab's own name."""


def untranslated(source: str) -> list[tuple[int, str]]:
    """(line, text) of what looks like words for people and stands in no call that translates, and of what stands in one
    and is no literal: nothing could read it from there."""
    tree = Parser(Language(tree_sitter_javascript.language())).parse(source.encode())
    return sorted(_untranslated(tree.root_node))


def keys_in(source: str) -> Iterator[tuple[int, str]]:
    """(line, key) of every text that a module marks."""
    tree = Parser(Language(tree_sitter_javascript.language())).parse(source.encode())
    nodes = [tree.root_node]
    while nodes:
        node = nodes.pop()
        nodes += node.named_children
        if node.type == "call_expression" and _called(node) in TRANSLATED:
            literal = [ast.literal_eval(_text(one)) for one in _arguments(node) if one.type == "string"]
            if literal:
                key = "\x04".join(literal[:2]) if _called(node) == "tc" else literal[0]
                yield node.start_point[0] + 1, key


def _untranslated(node: Node) -> Iterator[tuple[int, str]]:
    if node.type in ("import_statement", "comment"):
        return
    if node.type == "call_expression" and _called(node) in TRANSLATED:
        literal = [one for one in _arguments(node)[: 2 if _called(node) != "t" else 1] if one.type != "string"]
        yield from ((one.start_point[0] + 1, f"{_text(one)} (not a literal)") for one in literal)
    elif node.type in ("string", "template_string") and not _is_for_nobody(node):
        text = "".join("0" if part.type == "template_substitution" else _text(part) for part in node.named_children)
        if WORDS.search(text) and not CODE.search(text):
            yield node.start_point[0] + 1, text
    for child in node.named_children:
        yield from _untranslated(child)


def _is_for_nobody(node: Node) -> bool:
    """Whether a literal is a translated text already, or the value of something that nobody reads."""
    child, parent = node, node.parent
    while parent is not None:
        if parent.type == "arguments" and parent.parent is not None:
            return _called(parent.parent) in TRANSLATED | NO_WORDS_IN
        if parent.type == "pair" and child == parent.child_by_field_name("value"):
            return _last(parent.child_by_field_name("key")) in NO_WORDS
        if parent.type == "assignment_expression" and child == parent.child_by_field_name("right"):
            return _last(parent.child_by_field_name("left")) in NO_WORDS
        if parent.type.endswith(("statement", "declaration", "body")):
            return False
        child, parent = parent, parent.parent
    return False


def _called(call: Node) -> str:
    """The name of what is called: of a method, the method's, but for the console's."""
    function = call.child_by_field_name("function") or call.child_by_field_name("constructor")
    whole = _text(function) if function is not None else ""
    return whole if whole.startswith("console.") else whole.rpartition(".")[2]


def _arguments(call: Node) -> list[Node]:
    arguments = call.child_by_field_name("arguments")
    return arguments.named_children if arguments is not None else []


def _last(node: Node | None) -> str:
    return _text(node).strip("\"'").rpartition(".")[2] if node is not None else ""


def _text(node: Node) -> str:
    return (node.text or b"").decode()
