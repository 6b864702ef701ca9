"""Tuning of the trust: how often it looks, what it expects, and how long a doubt has to last."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ReturnsTuning:
    """Returns by sector and by beam against the usual ones."""

    memory_s: float = 10.0
    """Time over which the usual number of returns is averaged [s]. Greater: slower to follow another scene.
    Chosen on: judgement."""

    usual_share: float = 0.2
    """Share of the median sector's returns that a sector must usually have to be expected. Less: open sky and water
    are expected to return.
    Chosen on: judgement."""

    lost_share: float = 0.1
    """Share of the usual returns below which a sector is lost.
    Chosen on: judgement."""

    degraded_sectors: int = 4
    """Number of lost sectors from which a part of the view is reported as lost.
    Chosen on: simulated drives."""

    blind_share: float = 0.45
    """Share of the expected sectors from which the view is lost.
    Chosen on: half a view is blind."""

    beam_share: float = 0.03
    """Share of the usual returns of a band of beams, all around, below which the band is dead.
    Chosen on: simulated drives."""

    whole_share: float = 0.5
    """Share of its usual returns that a sector or a band has in the sweep before they end at once. Less: dust before
    the sky that a gust takes away is a lost part of the view.
    Chosen on: simulated drives past trees and houses, and over hills in dust."""

    thin_ratio: float = 0.78
    """Share of its usual returns that the fullest fifth of the cells has at least. Below it, returns are lost
    everywhere alike.
    Chosen on: 3.6 h of simulated drives, whose least is 0.8."""

    gain_ratio: float = 1.5
    """Share of its usual returns above which four fifths of the cells have more than this sensor gives. The sweep is
    then compared with the profile.
    Chosen on: simulated drives."""


@dataclass(frozen=True)
class LastingTuning:
    """Single beams and narrow sectors over a window of time."""

    window_s: float = 10.0
    """Time over which the returns of a beam are counted [s]. Less: earlier, and fewer beams have enough returns.
    Chosen on: reported within 30 s."""

    on_beam_share: float = 0.85
    """Share of the returns that lie on the beams of the profile, without which no beam is judged. Sensors without
    beams have a half.
    Chosen on: every fourth of 218 simulated drives, with beams dead from the start and later."""

    min_returns: float = 40.0
    """Fewest sampled returns of a window that a beam should have. Less: beams that meet little are judged.
    Chosen on: every fourth of 218 simulated drives, with beams dead from the start and later."""

    min_sectors: int = 4
    """Fewest directions in which the beams above and below have returns.
    Chosen on: judgement."""

    dead_share: float = 0.05
    """Share of the expected returns below which a beam is dead.
    Chosen on: every fourth of 218 simulated drives, with beams dead from the start and later."""

    dark_s: float = 8.0
    """Time after which a narrow sector is reported as blocked [s]. Less: who stands at the sensor is reported.
    Chosen on: judgement."""

    least_bearings: int = 5
    """Least width of a blocked sector, in parts of 5 deg.
    Chosen on: a sector of 30 deg, wherever it begins."""

    most_bearings: int = 24
    """Greatest width of a sector that never had a return, in parts of 5 deg. Wider ones are the design of a sensor.
    Chosen on: judgement."""

    least_usual: float = 5.0
    """Fewest sampled returns that a part of the view usually has to be expected.
    Chosen on: simulated drives, none by chance in a day."""

    whole_share: float = 0.5
    """Share of its usual returns that a part of the view has in the look before it is blocked.
    Chosen on: simulated hills."""

    nearest_m: float = 1.0
    """Nearest range of a sensor from which sectors whose view ends are not judged [m].
    Chosen on: simulated corridors."""

    near_share: float = 1.3
    """Share of the nearest range below which a return beside a sector without any is of a wall that goes on in it.
    Chosen on: simulated corridors."""

    lit_share: float = 0.1
    """Share of its usual returns from which it is not blocked.
    Chosen on: judgement."""

    edge_share: float = 0.65
    """Share of its usual returns from below that the view beside a sector has that ended slowly. Less: the edge of a
    drop is a cover.
    Chosen on: simulated drives along a quay."""

    gain: float = 0.005
    """Weight of a look in the usual returns. Greater: what fades is followed.
    Chosen on: a lens that fades in a minute."""


@dataclass(frozen=True)
class ThinningTuning:
    """Returns from below in the fullest directions."""

    first_looks: int = 10
    """Number of looks whose mean is that of the start.
    Chosen on: judgement."""

    mean_looks: int = 20
    """Number of looks over which the returns are averaged. Less: earlier, and chance is reported.
    Chosen on: 30 % of the returns lost in a minute."""

    memory_looks: int = 500
    """Number of looks after which the most returns are forgotten while none are missing. Less: a fault is followed.
    Chosen on: 30 % of the returns lost in a minute."""

    least_usual: float = 8.0
    """Fewest sampled returns from below of a direction with which they are judged.
    Chosen on: judgement."""

    missing_share: float = 0.25
    """Share of the returns from which on they are missing. Less: rain and dark ground are reported.
    Chosen on: simulated drives, whose most is 0.07, and the greatest difference between places of KITTI, 0.14."""


@dataclass(frozen=True)
class GroundTuning:
    """Steps of the ground."""

    gain: float = 0.1
    """Weight of the ground of a look in that which is known. Greater: obstacles on a slope are told from it earlier.
    Chosen on: judgement."""

    tilt_deg: float = 4.0
    """Change of the tilt from one frame to the next beyond which the sensor is reported as knocked [deg].
    Chosen on: simulated ramps and hills, and real drives."""

    height_share: float = 0.12
    """Change of the height from one frame to the next, as a share of it, beyond which it is reported.
    Chosen on: simulated ramps and hills, and real drives."""


@dataclass(frozen=True)
class MountTuning:
    """Tilt of the ground of the last looks against that of the first ones."""

    first_looks: int = 30
    """Number of looks with a known ground whose mean is that of the start. Less: earlier, and uneven ground at the
    start counts.
    Chosen on: judgement."""

    memory_looks: int = 15
    """Number of looks over which the ground is averaged later. Less: earlier, and uneven ground is reported.
    Chosen on: simulated drives over hills, ramps and stairs."""

    tilt_deg: float = 8.0
    """Tilt beyond which it is reported [deg]. Less: uneven ground is reported.
    Chosen on: simulated drives over hills, ramps and stairs."""


@dataclass(frozen=True)
class SceneTuning:
    """Obstacles against those of the sweep before, brought by the pose into the present one."""

    suspected: float = 0.85
    """All frames since the last look are compared if the share of the obstacle points at known places is below this
    and fell by more than `fall`, if it is below `same`, or while a change is known. Greater: more comparisons.
    Chosen on: simulated drives."""

    fall: float = 0.05
    """Fall of that share since the look before that all frames are compared for. Less: more comparisons.
    Chosen on: simulated drives."""

    same: float = 0.6
    """Share of the obstacle points at known places below which two sweeps show different scenes.
    Chosen on: simulated drives, in which the least is 0.82."""

    back: float = 0.75
    """Share of the obstacle points at the places before a change from which the scene is as it was.
    Chosen on: simulated drives."""

    better: float = 0.15
    """Share of the obstacle points by which an explanation is better than none.
    Chosen on: simulated drives."""

    explained: float = 0.75
    """Share of the obstacle points that a turn, a mirror or a scale has to bring to known places to explain another
    scene.
    Chosen on: simulated drives."""

    motion_looks: int = 12
    """Greatest number of looks over which the motion of obstacles tells whether a scene is back. Greater: longer ways
    tell smaller turns apart, at more cost while a scene is changed.
    Chosen on: simulated drives that end a fault elsewhere than it began."""

    surely_explained: float = 0.95
    """`explained` where the scene could be the one before, as between two like walls, or the ground has moved.
    Chosen on: simulated aisles."""


@dataclass(frozen=True)
class VisibilityTuning:
    """Visibility by the share of rays that end in the air."""

    depth_m: float = 12.0
    """Way on which returns of the air come [m]; the visibility is in proportion to it.
    Chosen on: simulated fog of 50 and 100 m, checked on snow of 2.5 mm/h."""

    mean_s: float = 0.5
    """Time over which the share is averaged [s].
    Chosen on: an alarm within 2 s."""

    most_m: float = 1000.0
    """Visibility from which it is good, and no figure is given [m].
    Chosen on: judgement."""

    degraded_m: float = 150.0
    """Visibility below which it is reported as a reason [m].
    Chosen on: half of it is about the range at which people are reported."""


@dataclass(frozen=True)
class TrustTuning:
    """Everything that is chosen in the trust."""

    returns: ReturnsTuning = ReturnsTuning()
    lasting: LastingTuning = LastingTuning()
    thinning: ThinningTuning = ThinningTuning()
    ground: GroundTuning = GroundTuning()
    mount: MountTuning = MountTuning()
    scene: SceneTuning = SceneTuning()

    look_s: float = 0.6
    """Time between two looks [s]. Less: earlier alarms, at more cost.
    Chosen on: an alarm within 2 s."""

    looks: int = 2
    """Number of looks in a row after which a lasting finding is reported.
    Chosen on: an alarm within 2 s."""

    back_looks: int = 3
    """Number of looks in a row without a finding after which it is withdrawn. Greater: another fault that begins
    meanwhile is found before the trust is good.
    Chosen on: good again within 3 s."""

    learn_s: float = 2.0
    """Time after the start before anything is expected [s].
    Chosen on: judgement."""
