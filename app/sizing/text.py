"""Steps and verdict in words: a line of a table as each step is measured, and the end of it."""

from __future__ import annotations

from collections.abc import Sequence

from app.sizing.rule import BUSY, LATE_MS, RESERVE, Bottleneck, Room, Step, Verdict, why_it_breaks

HEAD = (
    f"{'':8}{'tick late by, ms':^21}{'>' + format(LATE_MS, 'g') + ' ms':>8}{'cores of':^26}{'memory, MB':^15}"
    f"{'on disk, ms':^14}{'most':>8}\n"
    f"{'people':>8}{'p50':>7}{'p99':>7}{'most':>7}{'%':>8}{'lab':>6}{'workers':>8}{'people':>7}{'else':>5}{'each':>7}"
    f"{'all':>8}{'p50':>7}{'p99':>7}{'waiting':>8}"
)
GIVES_WAY: dict[Bottleneck, str] = {
    "workers": "the processor time of the sessions' processes: more cores hold more people",
    "web": "the lab's own process, which runs on one core: a faster core holds more people",
    "writer": "the disk: what happened waits to be on it; a faster one holds more people",
    "memory": "memory: more of it holds more people",
    "others": "other programs on this machine: measure again when it has nothing else to do",
    "people": "the scripted people themselves, not the lab: it may hold more than this says",
    "unknown": "nothing that was measured; something else on this machine may have taken it",
}


def people(number: int) -> str:
    """So many of them."""
    return f"{number} {'person' if number == 1 else 'people'}"


def line(step: Step) -> str:
    """One step of the table."""
    waiting = max(step.store_queue, step.session_queue, step.outgoing_queue)
    return (
        f"{step.sessions:8d}{step.late_p50_ms:7.1f}{step.late_p99_ms:7.1f}{step.late_most_ms:7.1f}"
        f"{100 * step.late_share:8.2f}{step.web_cores:6.2f}{step.worker_cores:8.2f}{step.people_cores:7.2f}"
        f"{step.others_cores:5.2f}{step.mb_per_session:7.1f}{step.lab_mb:8.0f}"
        f"{step.commit_p50_ms:7.1f}{step.commit_p99_ms:7.1f}{waiting:8d}"
        f"{'' if not why_it_breaks(step) else '  does not hold'}"
    )


def told(verdict: Verdict, steps: Sequence[Step], room: Room, scene: bool) -> tuple[str, ...]:
    """The verdict on these steps, a line each."""
    views = "with the 3-D view open" if scene else "with no 3-D view open"
    lines = []
    if not verdict.held:
        lines.append(f"This machine does not hold the first step, {views}: {verdict.broke or 'nothing was measured'}.")
    else:
        more = "" if verdict.broke else " No step broke: more --steps may find more."
        lines.append(
            f"This machine holds {people(verdict.capacity)} at once, {views}: {verdict.held} held, and "
            f"{100 * RESERVE:.0f} % of that is kept in reserve.{more}"
        )
        if verdict.broke:
            lines.append(f"Beyond {verdict.held}: {verdict.broke}.")
    if verdict.broke:
        lines.append(f"What gives way first: {GIVES_WAY[verdict.bottleneck]}.")
    busy = steps[-1].others_cores if steps else 0.0
    if busy > BUSY * room.cores:
        lines.append(f"In the last step other programs took {busy:.1f} of {room.cores} cores: it may hold more.")
    if room.lab_cores < room.cores:
        lines.append(f"Measured with {room.lab_cores} of {room.cores} cores for the lab; the people had the others.")
    elif last := [step for step in steps if step.sessions == verdict.held][-1:]:
        share = 100 * last[0].people_cores / room.cores
        lines.append(f"Meanwhile {share:.0f} % of the processor time went to the scripted people.")
    return tuple(lines)
