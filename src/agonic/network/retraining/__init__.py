"""What keeps a network up to date: its base moved on, candidates judged, changes noticed."""

from agonic.network.retraining.acceptance import (
    CERTAIN,
    Judgement,
    Unseen,
    best_of,
    changed,
    held_out,
    judged,
    noise_of_rows,
    stuck,
)
from agonic.network.retraining.findings import findings
from agonic.network.retraining.model_change import movable, moved
from agonic.network.retraining.schedule import (
    Due,
    begun,
    brought_forward,
    due_at,
    is_full,
    pushed,
    started,
    taken,
    watching,
)

__all__ = [
    "CERTAIN",
    "Due",
    "Judgement",
    "Unseen",
    "begun",
    "best_of",
    "brought_forward",
    "changed",
    "due_at",
    "findings",
    "held_out",
    "is_full",
    "judged",
    "movable",
    "moved",
    "noise_of_rows",
    "pushed",
    "started",
    "stuck",
    "taken",
    "watching",
]
