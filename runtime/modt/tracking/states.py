"""The finite-state machines of a proposal, as tables (Tables I and II, Figs. 3 and 6).

A row names an event, the state that it leaves and the state that it leads to. In each state an event has one row at
most, so arrays of states are driven by one dense look-up. Rows a1 to a14 are the paper's; rows e1 and on are
extensions: the paper has no budget, so it has no object that waits for its first class, and no review of a
confirmed class.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property

import numpy as np

from modt.types import NONE, Bool, Int


class UndefinedTransitionError(ValueError):
    """A state met an event that its machine has no row for."""


class StateEvent(IntEnum):
    """Events that change the state of a proposal or track."""

    ASSOCIATED = 0
    """Proposal and track were associated."""
    UNASSOCIATED = 1
    """The proposal has no track, or the track has no proposal."""
    EXPIRED = 2
    """The track went without a proposal for more than N frames."""
    JOINS_FINAL = 3
    """The proposal joins a track whose class is confirmed."""
    JOINS_UNCERTAIN = 4
    """The proposal joins a track that was classified, but whose class is unconfirmed."""
    JOINS_WAITING = 5
    """The proposal joins a track that waits for its first classification."""
    CLASSIFIED = 6
    """A classification confirms the class."""
    UNDECIDED = 7
    """A classification leaves the class unconfirmed."""


@dataclass(frozen=True)
class State:
    """A state of a proposal or track.

    Attributes:
        name: as in the paper's figure.
        wants_class: the class is asked for.
        final: the class is confirmed.
        joining: event of a proposal that joins a track in this state, fired after ASSOCIATED.
    """

    name: str
    wants_class: bool = False
    final: bool = False
    joining: StateEvent = StateEvent.JOINS_WAITING


@dataclass(frozen=True)
class Transition:
    """One row of a table.

    Attributes:
        source: state that it leaves.
        label: name of the row in the table.
        target: state that it leads to.
        event: event that fires it.
        meaning: the table's description, in a phrase.
    """

    source: str
    label: str
    target: str
    event: StateEvent
    meaning: str


@dataclass(frozen=True)
class StateMachine:
    """A table of transitions over states; a state's value is its index.

    Attributes:
        title: which table it is.
        states: the first is a new proposal's, the last is the end.
        transitions: the rows.
    """

    title: str
    states: tuple[State, ...]
    transitions: tuple[Transition, ...]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the states."""
        return tuple(state.name for state in self.states)

    @property
    def proposal(self) -> int:
        """State of a proposal before association."""
        return 0

    def index(self, name: str) -> int:
        """Value of a state."""
        return self.names.index(name)

    @cached_property
    def after(self) -> Int:
        """(S, E) state that each event leads to, NONE where the table has no row."""
        after = np.full((len(self.states), len(StateEvent)), NONE, np.int64)
        for t in self.transitions:
            after[self.index(t.source), t.event] = self.index(t.target)
        return after

    @cached_property
    def wants_class(self) -> Bool:
        """(S,) whether the class is asked for."""
        return np.array([state.wants_class for state in self.states])

    @cached_property
    def final(self) -> Bool:
        """(S,) whether the class is confirmed."""
        return np.array([state.final for state in self.states])

    @cached_property
    def joining(self) -> Int:
        """(S,) event of a proposal that joins a track in each state."""
        return np.array([state.joining for state in self.states])

    def transition(self, states: Int, events: StateEvent | Int) -> Int:
        """(M,) states after an event, one for all or one each.

        Raises:
            UndefinedTransitionError: the table has no row for one of them.
        """
        after: Int = self.after[states, events]
        if after.min(initial=0) == NONE:
            bad = (after == NONE).nonzero()[0][0]
            event = StateEvent(np.broadcast_to(events, after.shape)[bad])
            raise UndefinedTransitionError(f"{self.title}: {event.name} in state {self.names[states[bad]]}")
        return after

    def joined(self, states: Int) -> Int:
        """(M,) states of proposals that were matched with tracks in these states (a1, then what they join)."""
        matched = self.transition(np.array([self.proposal]), StateEvent.ASSOCIATED)
        return self.transition(matched.repeat(len(states)), self.joining[states])


_E = StateEvent

_WAITING = (
    Transition("unmatched", "e1", "unmatched", _E.ASSOCIATED, "followed while it waits to be classified"),
    Transition("matched", "e2", "unmatched", _E.JOINS_WAITING, "joins an object that waits"),
    Transition("unmatched", "e3", "lost_unmatched", _E.UNASSOCIATED, "no proposal while it waits"),
    Transition("lost_unmatched", "e4", "unmatched", _E.ASSOCIATED, "re-associated, still waiting"),
    Transition("lost_unmatched", "e5", "lost_unmatched", _E.UNASSOCIATED, "still no proposal"),
    Transition("lost_unmatched", "e6", "deleted", _E.EXPIRED, "no proposal for N frames"),
)
"""A track without a class waits for the frame's budget, or for a box like an object's."""

EFFICIENT = StateMachine(
    title="Table I",
    states=(
        State("proposal"),
        State("matched"),
        State("unmatched", wants_class=True),
        State("tracked", final=True, joining=_E.JOINS_FINAL),
        State("lost", final=True),
        State("lost_unmatched"),
        State("deleted"),
    ),
    transitions=(
        Transition("proposal", "a1", "matched", _E.ASSOCIATED, "associated with an existing object"),
        Transition("proposal", "a2", "unmatched", _E.UNASSOCIATED, "associated with none"),
        Transition("unmatched", "a3", "tracked", _E.CLASSIFIED, "classified"),
        Transition("unmatched", "e13", "unmatched", _E.UNDECIDED, "classified, unconfirmed"),
        Transition("tracked", "a4", "tracked", _E.ASSOCIATED, "its proposal updates its location"),
        Transition("matched", "a5", "tracked", _E.JOINS_FINAL, "given the object's class"),
        Transition("tracked", "a6", "lost", _E.UNASSOCIATED, "no proposal"),
        Transition("lost", "a7", "tracked", _E.ASSOCIATED, "re-associated"),
        Transition("lost", "a8", "lost", _E.UNASSOCIATED, "still no proposal"),
        Transition("lost", "a9", "deleted", _E.EXPIRED, "no proposal for N frames"),
        *_WAITING,
    ),
)
"""Table I and Fig. 3: classify once, then track."""

CONVENTIONAL = replace(
    EFFICIENT,
    title="Table I, every frame classified",
    states=tuple(replace(state, final=False) for state in EFFICIENT.states),
    transitions=(
        *(t for t in EFFICIENT.transitions if t.event is not _E.UNDECIDED),
        Transition("tracked", "e7", "tracked", _E.CLASSIFIED, "classified in every frame"),
    ),
)
"""Tracking by detection over the same states. `final` is false in all of them, as each frame is classified anew."""

ACCURATE = StateMachine(
    title="Table II",
    states=(
        State("proposal"),
        State("matched"),
        State("unmatched", wants_class=True),
        State("tracked_unclassified", wants_class=True, joining=_E.JOINS_UNCERTAIN),
        State("tracked_classified", final=True, joining=_E.JOINS_FINAL),
        State("lost_unclassified"),
        State("lost_classified", final=True),
        State("lost_unmatched"),
        State("deleted"),
    ),
    transitions=(
        Transition("proposal", "a1", "matched", _E.ASSOCIATED, "associated with an existing object"),
        Transition("proposal", "a2", "unmatched", _E.UNASSOCIATED, "associated with none"),
        Transition("unmatched", "a3", "tracked_unclassified", _E.UNDECIDED, "classified, unconfirmed"),
        Transition("unmatched", "a4", "tracked_classified", _E.CLASSIFIED, "classified, confirmed"),
        Transition("matched", "a5", "tracked_unclassified", _E.JOINS_UNCERTAIN, "joins an unclassified object"),
        Transition("matched", "a6", "tracked_classified", _E.JOINS_FINAL, "joins a classified object"),
        Transition("tracked_classified", "a7", "tracked_classified", _E.ASSOCIATED, "its proposal updates it"),
        Transition("tracked_unclassified", "a8", "tracked_classified", _E.CLASSIFIED, "views confirm it"),
        Transition("tracked_unclassified", "a9", "tracked_unclassified", _E.ASSOCIATED, "its proposal updates it"),
        Transition("tracked_classified", "a10", "lost_classified", _E.UNASSOCIATED, "no proposal"),
        Transition("lost_classified", "a11", "tracked_classified", _E.ASSOCIATED, "re-associated"),
        Transition("tracked_unclassified", "a12", "lost_unclassified", _E.UNASSOCIATED, "no proposal"),
        Transition("lost_unclassified", "a13", "tracked_unclassified", _E.ASSOCIATED, "re-associated"),
        Transition("lost_classified", "a14", "deleted", _E.EXPIRED, "no proposal for N frames"),
        Transition("lost_unclassified", "a14", "deleted", _E.EXPIRED, "no proposal for N frames"),
        *_WAITING,
        Transition("tracked_unclassified", "e7", "tracked_unclassified", _E.UNDECIDED, "views leave it unconfirmed"),
        Transition("lost_classified", "e8", "lost_classified", _E.UNASSOCIATED, "still no proposal"),
        Transition("lost_unclassified", "e9", "lost_unclassified", _E.UNASSOCIATED, "still no proposal"),
        Transition("tracked_classified", "e10", "tracked_classified", _E.CLASSIFIED, "review confirms it"),
        Transition("tracked_classified", "e11", "tracked_unclassified", _E.UNDECIDED, "review leaves it unconfirmed"),
    ),
)
"""Table II and Fig. 6: classify until the class is confirmed.

The paper's a12 repeats the words of a10 ("tracked classified objects are not associated"); Fig. 6 and a13 leave only
one meaning, that of the unclassified ones.
"""
