"""The finite-state machines of a proposal, as tables (Tables I and II, Figs. 3 and 6).

A table says where each event leads. What befalls a track (it found a proposal, it was classified, ...) is a
`Event`; in each state at most one event of the table answers to it, so arrays of states are driven by one dense
look-up. Events a1 to a14 are the paper's; those named e1 and on are extensions: the paper knows no budget, so it has
no word for an object that waits for its first class, and no way back from a class that was inherited in error.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np

from modt.types import NONE, Bool, Int


class UndefinedTransitionError(ValueError):
    """A state met an event or a happening that its machine has no transition for."""


class Event(IntEnum):
    """What can befall a proposal or the track that it becomes."""

    ASSOCIATED = 0
    """Proposal and track found each other."""
    UNASSOCIATED = 1
    """They did not."""
    EXPIRED = 2
    """A track went without a proposal for more than N frames."""
    INHERITS_CLASS = 3
    """The track that the proposal joined has a certain class."""
    INHERITS_DOUBT = 4
    """The track that the proposal joined was classified, without certainty."""
    INHERITS_NOTHING = 5
    """The track that the proposal joined still waits for its first classification."""
    CLASSIFIED = 6
    """The class is certain now."""
    UNDECIDED = 7
    """Classified, without certainty."""
    DOUBTED = 8
    """What was inherited proved not to hold: the class must be asked for."""


@dataclass(frozen=True, slots=True)
class Transition:
    """One row of a table.

    Attributes:
        source: state it leaves.
        event: the table's name of it.
        target: state it leads to.
        happening: what sets it off.
        meaning: the table's description, in a phrase.
    """

    source: str
    label: str
    target: str
    event: Event
    meaning: str


@dataclass(frozen=True)
class StateMachine:
    """A table of transitions over named states; a state's value is its index in names.

    Attributes:
        title: which table it is.
        names: the states; the first is a fresh proposal's, the last is the end.
        transitions: the rows.
        asking: states in which the class is asked for.
        certain: states in which it is settled.
        waiting: states before the first classification.
    """

    title: str
    names: tuple[str, ...]
    transitions: tuple[Transition, ...]
    asking: frozenset[str]
    certain: frozenset[str]
    waiting: frozenset[str] = frozenset({"unmatched", "lost_unmatched"})

    @property
    def proposal(self) -> int:
        """State of a proposal before association."""
        return 0

    @property
    def deleted(self) -> int:
        """State that nothing leaves."""
        return len(self.names) - 1

    def index(self, name: str) -> int:
        """Value of a state."""
        return self.names.index(name)

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Names of the events, in the table's order."""
        return tuple(dict.fromkeys(t.label for t in self.transitions))

    @cached_property
    def table(self) -> Int:
        """(S, E) state that each event leads to, NONE where undefined."""
        table = np.full((len(self.names), len(self.labels)), NONE, np.int64)
        for t in self.transitions:
            table[self.index(t.source), self.labels.index(t.label)] = self.index(t.target)
        return table

    @cached_property
    def answer(self) -> Int:
        """(S, H) event that answers to each happening, NONE where none does."""
        answer = np.full((len(self.names), len(Event)), NONE, np.int64)
        for t in self.transitions:
            answer[self.index(t.source), t.event] = self.labels.index(t.label)
        return answer

    @cached_property
    def after(self) -> Int:
        """(S, H) state that each happening leads to, NONE where none answers to it."""
        after = np.full(self.answer.shape, NONE, np.int64)
        states, events = np.nonzero(self.answer != NONE)
        after[states, events] = self.table[states, self.answer[states, events]]
        return after

    @cached_property
    def asks(self) -> Bool:
        """(S,) whether a state asks for a class."""
        return self._among(self.asking)

    @cached_property
    def knows(self) -> Bool:
        """(S,) whether the class is settled in a state."""
        return self._among(self.certain)

    def fire(self, states: Int, labels: Int) -> Int:
        """(M,) states after events (M,), by index in the table's events.

        Raises:
            UndefinedTransitionError: one of them has no such transition.
        """
        after: Int = self.table[states, labels]
        bad = ((after == NONE) | (np.broadcast_to(labels, np.shape(after)) == NONE)).nonzero()[0]
        if len(bad):
            state, label = states[bad[0]], np.broadcast_to(labels, after.shape)[bad[0]]
            what = self.labels[label] if label != NONE else "no event of the table"
            raise UndefinedTransitionError(f"{self.title}: {what} in state {self.names[state]}")
        return after

    def transition(self, states: Int, event: Event | Int) -> Int:
        """(M,) states after what befell them, one happening for all or one each.

        Raises:
            UndefinedTransitionError: one of them has no answer to it.
        """
        after: Int = self.after[states, event]
        if NONE in after:
            self.fire(states, self.answer[states, event])  # says which of them
        return after

    def inherits(self, states: Int) -> Int:
        """(M,) happening that joining a track in each state is to a proposal."""
        waits = self._among(self.waiting)
        kinds = np.where(
            self.knows,
            Event.INHERITS_CLASS,
            np.where(waits, Event.INHERITS_NOTHING, Event.INHERITS_DOUBT),
        )
        joined: Int = kinds[states]
        return joined

    def _among(self, names: frozenset[str] | set[str]) -> Bool:
        return np.array([n in names for n in self.names], np.bool_)


_H = Event

WAITING = (
    Transition("unmatched", "e1", "unmatched", _H.ASSOCIATED, "followed while it waits to be classified"),
    Transition("matched", "e2", "unmatched", _H.INHERITS_NOTHING, "joins an object that waits"),
    Transition("unmatched", "e3", "lost_unmatched", _H.UNASSOCIATED, "no proposal while it waits"),
    Transition("lost_unmatched", "e4", "unmatched", _H.ASSOCIATED, "re-associated, still waiting"),
    Transition("lost_unmatched", "e5", "lost_unmatched", _H.UNASSOCIATED, "still no proposal"),
    Transition("lost_unmatched", "e6", "deleted", _H.EXPIRED, "no proposal for N frames"),
)
"""What neither table tells: a track without a class waits for the frame's budget, or for a box like an object's."""

EFFICIENT = StateMachine(
    title="Table I",
    names=("proposal", "matched", "unmatched", "tracked", "lost", "lost_unmatched", "deleted"),
    asking=frozenset({"unmatched"}),
    certain=frozenset({"tracked", "lost"}),
    transitions=(
        Transition("proposal", "a1", "matched", _H.ASSOCIATED, "associated with an existing object"),
        Transition("proposal", "a2", "unmatched", _H.UNASSOCIATED, "associated with none"),
        Transition("unmatched", "a3", "tracked", _H.CLASSIFIED, "classified"),
        Transition("tracked", "a4", "tracked", _H.ASSOCIATED, "its proposal updates its location"),
        Transition("matched", "a5", "tracked", _H.INHERITS_CLASS, "given the object's class"),
        Transition("tracked", "a6", "lost", _H.UNASSOCIATED, "no proposal"),
        Transition("lost", "a7", "tracked", _H.ASSOCIATED, "re-associated"),
        Transition("lost", "a8", "lost", _H.UNASSOCIATED, "still no proposal"),
        Transition("lost", "a9", "deleted", _H.EXPIRED, "no proposal for N frames"),
        *WAITING,
        Transition("tracked", "e7", "unmatched", _H.DOUBTED, "an inherited class did not hold"),
    ),
)
"""Table I and Fig. 3: classify once, then track."""

ACCURATE = StateMachine(
    title="Table II",
    names=(
        "proposal",
        "matched",
        "unmatched",
        "tracked_unclassified",
        "tracked_classified",
        "lost_unclassified",
        "lost_classified",
        "lost_unmatched",
        "deleted",
    ),
    asking=frozenset({"unmatched", "tracked_unclassified"}),
    certain=frozenset({"tracked_classified", "lost_classified"}),
    transitions=(
        Transition("proposal", "a1", "matched", _H.ASSOCIATED, "associated with an existing object"),
        Transition("proposal", "a2", "unmatched", _H.UNASSOCIATED, "associated with none"),
        Transition("unmatched", "a3", "tracked_unclassified", _H.UNDECIDED, "classified, uncertain"),
        Transition("unmatched", "a4", "tracked_classified", _H.CLASSIFIED, "classified, distinct"),
        Transition("matched", "a5", "tracked_unclassified", _H.INHERITS_DOUBT, "joins an unclassified object"),
        Transition("matched", "a6", "tracked_classified", _H.INHERITS_CLASS, "joins a classified object"),
        Transition("tracked_classified", "a7", "tracked_classified", _H.ASSOCIATED, "its proposal updates it"),
        Transition("tracked_unclassified", "a8", "tracked_classified", _H.CLASSIFIED, "fused views are certain"),
        Transition("tracked_unclassified", "a9", "tracked_unclassified", _H.ASSOCIATED, "its proposal updates it"),
        Transition("tracked_classified", "a10", "lost_classified", _H.UNASSOCIATED, "no proposal"),
        Transition("lost_classified", "a11", "tracked_classified", _H.ASSOCIATED, "re-associated"),
        Transition("tracked_unclassified", "a12", "lost_unclassified", _H.UNASSOCIATED, "no proposal"),
        Transition("lost_unclassified", "a13", "tracked_unclassified", _H.ASSOCIATED, "re-associated"),
        Transition("lost_classified", "a14", "deleted", _H.EXPIRED, "no proposal for N frames"),
        Transition("lost_unclassified", "a14", "deleted", _H.EXPIRED, "no proposal for N frames"),
        *WAITING,
        Transition("tracked_classified", "e7", "unmatched", _H.DOUBTED, "an inherited class did not hold"),
        Transition("lost_classified", "e8", "lost_classified", _H.UNASSOCIATED, "still no proposal"),
        Transition("lost_unclassified", "e9", "lost_unclassified", _H.UNASSOCIATED, "still no proposal"),
        Transition("tracked_unclassified", "e10", "tracked_unclassified", _H.UNDECIDED, "fused views leave doubt"),
    ),
)
"""Table II and Fig. 6: classify until certain.

The paper's a12 repeats the words of a10 ("tracked classified objects are not associated"); Fig. 6 and a13 leave it
only one sense, that of the unclassified ones, and so it stands here.
"""
