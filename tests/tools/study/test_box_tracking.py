"""Judgement of tracked boxes on a hand-made frame."""

from tools.study.box_tracking import association

PLACE = "1.7 0.6 0.8 {x} 1.6 20 0"


def line(id_, kind, x, occluded=0, top=100):
    return f"0 {id_} {kind} 0 {occluded} 0 {x * 10} {top} {x * 10 + 20} 160 {PLACE.format(x=x)}".split()


def test_boxes_on_what_does_not_count_are_left_out():
    truth = [line(1, "Pedestrian", 0), line(2, "Person", 5), line(3, "Pedestrian", 10, occluded=3)]
    truth.append(["0", "-1", "DontCare", *["-1"] * 3, "195", "90", "225", "170", *["-1"] * 7])
    tracked = [
        line(7, "Pedestrian", x, top=top)
        for x, top in ((0.1, 100), (5, 100), (10, 100), (20, 100), (30, 100), (40, 140))
    ]
    tracked = [[row[0], str(7 + k), *row[2:]] for k, row in enumerate(tracked)]
    found = association("Pedestrian", truth, [*tracked, line(99, "Car", 0)])
    assert list(found.truth) == [1]
    assert list(found.track) == [7, 11]
    assert found.similarity[0, 0] > 0.7
    assert found.similarity[0, 1] == 0
