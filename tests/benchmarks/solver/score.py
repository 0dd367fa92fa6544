"""One line of a verification table, and what it is worth."""

from dataclasses import dataclass

CLOSE = 0.02  # asked for: within 2 % of the best four-node element, or better


@dataclass(frozen=True)
class Peer:
    """What another element scores on the same mesh."""

    name: str  # of the element
    ratio: float  # its value over the target


@dataclass(frozen=True, kw_only=True)
class Score:
    """Our value of one quantity of one test on one mesh."""

    test: str  # such as "Cook's membrane"
    case: str  # quantity, with its load
    mesh: str  # elements along the sides
    target: float  # what is right
    value: float  # ours
    unit: str  # of both
    source: str  # of the target
    # Best other four-node element on this mesh, None where no figure is at hand
    peer: Peer | None = None
    reason: str = ""  # why we miss it, for a score that does

    @property
    def ratio(self) -> float:
        """Value over target; for a target of zero the value itself plus one."""
        return self.value / self.target if self.target else 1.0 + self.value

    @property
    def error(self) -> float:
        """Distance of the ratio from one."""
        return abs(self.ratio - 1.0)

    @property
    def reached(self) -> bool:
        """Whether the error exceeds that of the best peer by 2 % at most (of zero without one)."""
        allowed = CLOSE + (abs(self.peer.ratio - 1.0) if self.peer else 0.0)
        # The figures of peers have three digits.
        return self.error <= allowed + 5e-4

    @property
    def verdict(self) -> str:
        """In words, for the table."""
        if not self.reached:
            return f"behind: {self.reason}" if self.reason else "behind"
        if self.peer is None:
            return "within 2 %"
        return "best" if self.error <= abs(self.peer.ratio - 1.0) + 5e-4 else "within 2 % of best"


@dataclass(frozen=True)
class ElementTest:
    """What rows of one test share: its name, unit, source of the targets, and why we miss them."""

    name: str
    unit: str
    source: str
    reason: str = ""

    def score(
        self, case: str, mesh: str, target: float, value: float, peer: Peer | None = None
    ) -> Score:
        """One row."""
        return Score(
            test=self.name,
            case=case,
            mesh=mesh,
            target=target,
            value=value,
            unit=self.unit,
            source=self.source,
            peer=peer,
            reason=self.reason,
        )


def best_peer(peers: dict[str, float]) -> Peer | None:
    """The peer nearest to one."""
    if not peers:
        return None
    name = min(peers, key=lambda key: abs(peers[key] - 1.0))
    return Peer(name, peers[name])
