"""Loops over rows of which most need nothing done: those that do are listed once, and loops go through the list.

A row is idle if all that a loop makes of it is behind one mask, which a number of the row tells: where that fails for all
states of a group, nothing is written. Of many loops over the same rows the numbers are the same: so is the list.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from articulated.compiler.branches import Branch, branched
from articulated.compiler.graph import Node
from articulated.compiler.ir import Format, Text
from articulated.compiler.schedule import Chunk, Item, Repeat, Schedule, flattened


@dataclass(frozen=True)
class Listing:
    """The rows whose number, one of these nodes each, is larger than `least` for some state of a group."""

    numbers: tuple[int, ...]
    least: float


def listing(chunk: Chunk, schedule: Schedule) -> Listing | None:
    """The rows that a chunk, which is all of a loop over rows, does something for; None if that is not known."""
    nodes = schedule.nodes
    if chunk.rows is None or chunk.copies:
        return None
    *tests, branch = branched(nodes, schedule.guards, chunk.nodes)
    if not isinstance(branch, Branch) or tests != [branch.mask]:
        return None
    match nodes[branch.mask]:
        case ("lt", least, column) if nodes[least][0] == "const" and nodes[column][:2] == ("column", chunk.rows.region):
            put = {i for i, _, _ in chunk.yields}
            if put <= set(branch.yields) and all(_is_idle(i, i in put, chunk, nodes) for i in branch.yields):
                return Listing(chunk.rows.columns[nodes[column][2]], nodes[least][1])
    return None


def is_undefined(node: Node) -> bool:
    """Whether nobody looks at it."""
    return node[0] == "const" and node[1] != node[1]


def _is_idle(i: int, is_put: bool, chunk: Chunk, nodes: Sequence[Node]) -> bool:
    """Whether a node that others see behind a branch is not written, or stays as it is, where the branch is not taken."""
    op, *_, otherwise = nodes[i]
    if op != "given":
        return False
    if i in chunk.kept:
        return not is_put and chunk.kept[i] == (otherwise, None)
    return is_put and is_undefined(nodes[int(otherwise)])


def wanted(items: Sequence[Item], schedule: Schedule) -> Iterator[Listing]:
    """The lists that items need, those in loops too."""
    for item in flattened(items):
        if isinstance(item, Chunk) and (found := listing(item, schedule)):
            yield found


def known(items: Sequence[Item], schedule: Schedule) -> set[int]:
    """The nodes that items compute, and those that their loops make of rows; but not those that loops compute."""
    found: set[int] = set()
    loops = set()
    for item in items:
        if isinstance(item, Chunk):
            found |= set(item.nodes)
        elif isinstance(item, Repeat):
            loops.add(item.loop.region)
    return found | {i for (loop, _, _), i in schedule.made.items() if loop in loops}


def list_function(name: str, rows: Listing, place: int, places: Sequence[int], f: Format) -> str:
    """The function `void name(scratch)` that writes a list: how many rows, then which.

    Args:
        name: of the function.
        rows: which belong there.
        place: where the list is in scratch [bytes].
        places: and where the rows' numbers are.
        f: of numbers.
    """
    text = Text(f)
    entries = ", ".join(f"i32 {x}" for x in places)
    table = f"@{name}.rows = internal constant [{len(places)} x i32] [{entries}]"
    there = text.at("%scratch", place)
    with text.loop(len(places), "i64", ["0"]) as turn:
        entry = text.load(text.let(f"getelementptr i32, ptr @{name}.rows, i64 {turn.k}"), "i32", 4)
        x = text.load(text.at("%scratch", text.let(f"sext i32 {entry} to i64")), text.V, f.vector_bytes)
        text.keep(turn.k, text.entry(there, text.integer("add", turn.values[0], 1)))
        needed = text.any(text.let(f"fcmp olt {text.V} {f.constant(rows.least)}, {x}"))
        turn.following = [text.integer("add", turn.values[0], needed)]
    text.keep(turn.values[0], there)
    return "\n".join([table, text.function("void", name, "ptr noalias %scratch")])
