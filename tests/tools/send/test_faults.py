"""Faults of a network."""

from tools.send.faults import PacketFaults

PACKETS = [(0.1 * k, bytes([k])) for k in range(200)]


def applied(**shares):
    return list(PacketFaults(**shares).applied(PACKETS))


def test_a_seed_decides_on_the_faults_and_without_shares_there_are_none():
    assert applied() == PACKETS
    shares = {"lost": 0.1, "duplicated": 0.1, "reordered": 0.1, "garbage": 0.1}
    assert applied(**shares, seed=1) == applied(**shares, seed=1) != applied(**shares, seed=2)


def test_each_fault_is_of_its_kind():
    payloads = [p for _, p in PACKETS]
    lost = [p for _, p in applied(lost=0.2)]
    assert 120 < len(lost) < 190
    assert lost == [p for p in payloads if p in set(lost)]
    doubled = [p for _, p in applied(duplicated=0.2)]
    assert sorted(set(doubled)) == payloads
    assert len(doubled) > 210
    disordered = [p for _, p in applied(reordered=0.2)]
    assert disordered != payloads
    assert sorted(disordered) == payloads[: len(disordered)]
    assert len([p for _, p in applied(garbage=0.2)]) > 210
