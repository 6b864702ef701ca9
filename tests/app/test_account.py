"""The lines at the end of a run about what was read."""

from modt.app.account import closing_lines

READ = {
    "used": 9,
    "messages": 9,
    "left_out": {},
    "without_pose": 0,
    "alone": {},
    "poses": "/odom",
    "not_deskewed": {},
}


def test_only_what_is_missing_is_told():
    assert closing_lines(READ) == []
    (line,) = closing_lines({**READ, "without_pose": 4})
    assert line == "4 frames have no pose of /odom near them: they are registered"
