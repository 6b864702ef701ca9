import numpy as np
import pytest
from numpy.testing import assert_allclose

from modt.classes import ObjectClass
from modt.errors import MisuseError
from modt_evaluation.box_tracking.detections import files, read

AB3DMOT = "0,2,298.3,165.2,458.2,293.4,8.3,1.96,1.81,4.75,-4.57,1.84,13.53,-2.11,-1.79\n"
LABEL = "0 7 Car 0 0 -1.79 298.3 165.2 458.2 293.4 1.96 1.81 4.75 -4.57 1.84 13.53 -2.11 8.3\n"


def write(tmp_path, text):
    path = tmp_path / "0000.txt"
    path.write_text(text)
    return path


def one(path):
    """The detections of a file alone."""
    (found,) = read([path])
    return found


def test_both_formats_give_the_same_detections(tmp_path):
    a = one(write(tmp_path, AB3DMOT))
    b = one(write(tmp_path, LABEL))
    assert_allclose(a.box, b.box)
    assert_allclose(a.score, b.score)
    assert_allclose(a.image_box, b.image_box)
    assert a.object_class[0] == b.object_class[0] == ObjectClass.CAR
    assert_allclose(a.box[0, :6], [13.53, 4.57, 1.96 / 2 - 1.84, 4.75, 1.81, 1.96])


def test_frames_without_detections_are_kept_and_other_types_ignored(tmp_path):
    assert len(one(write(tmp_path, LABEL.replace("Car", "DontCare")))) == 0
    assert one(write(tmp_path, "")).n_frames == 0
    later = AB3DMOT.replace("0,2,", "3,2,", 1)
    found = one(write(tmp_path, later + AB3DMOT + AB3DMOT))
    assert [rows.stop - rows.start for _, rows in found.frames()] == [2, 0, 0, 1]


@pytest.mark.parametrize(
    "text", ["1,2,3\n", "a,b\n", "0 7 Car 0 0\n", AB3DMOT.replace("8.3", "nan"), AB3DMOT.replace("0,", "-1,", 1)]
)
def test_an_invalid_line_is_refused_by_number(tmp_path, text):
    with pytest.raises(MisuseError, match=r"0000\.txt:2"):
        one(write(tmp_path, AB3DMOT + text))


def test_a_folder_without_files_and_a_missing_file_are_refused(tmp_path):
    with pytest.raises(MisuseError, match=r"no \.txt"):
        files(tmp_path)
    write(tmp_path, "")
    assert [file.name for file in files(tmp_path)] == ["0000.txt"]
    with pytest.raises(MisuseError, match="cannot be read"):
        one(tmp_path / "none.txt")


def scored(path, *scores):
    """A file with a detection of these scores in each frame."""
    path.write_text("".join(f"{i},2,0,0,9,9,{score},1.5,1.6,4,0,1.5,9,0,0\n" for i, score in enumerate(scores)))
    return path


def test_probabilities_are_converted_to_log_odds(tmp_path):
    def scores(*given):
        return one(scored(tmp_path / "a.txt", *given)).score.tolist()

    even = scores(0.5)[0]
    assert scores(0.1, 0.9) == pytest.approx([even - np.log(9), even + np.log(9)])
    assert np.isfinite(scores(0.0, 1.0)).all()
    assert scores(0.5, 1.5) == [0.5, 1.5]  # no probabilities: unchanged


def test_all_files_of_a_detector_share_a_scale(tmp_path):
    quiet = scored(tmp_path / "0.txt", 0.25)
    busy = scored(tmp_path / "1.txt", 0.5, 7.0)
    assert one(quiet).score.tolist() != [0.25]
    assert [d.score.tolist() for d in read([quiet, busy])] == [[0.25], [0.5, 7.0]]
    assert [d.name for d in read([quiet, busy])] == ["0", "1"]
