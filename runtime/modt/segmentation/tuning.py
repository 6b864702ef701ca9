"""Values of the segmentation that were chosen, by mechanism.

*KITTI scans* below means labelled scans of KITTI's object benchmark and of its odometry sequences, with a check on
drive 0005 and on simulated streets. *Sensor study* means the labelled and simulated sweeps of fourteen sensors that
`tools.study.segmentation_recall` counts.
"""

from __future__ import annotations

from dataclasses import dataclass

from modt.class_sizes import HIDDEN_PERSON, RAISED_PERSON, SPLIT_PERSON, STRIP_PERSON, PersonSize


@dataclass(frozen=True)
class PolarGridTuning:
    """Cells of the polar grid on which the ground is found."""

    ring_step: float = 0.15
    """Width of a ring [sqrt(m)], 0.9 m at 10 m and 1.9 m at 40 m. Wider rings find fewer kerbs and hold more returns.
    Chosen on: KITTI scans."""
    flat_m: float = 0.1
    """Height range of the returns of a cell above which something stands in it [m]. Chosen on: KITTI scans."""
    flat_slope: float = 0.2
    """Growth of `flat_m` with the width of the cell [m/m], so that slopes stay flat.
    Chosen on: KITTI scans."""


@dataclass(frozen=True)
class SensorHeightTuning:
    """Estimate of the sensor's height, where the profile has none."""

    default_m: float = 1.73
    """Height used until ground is in sight [m]. Chosen on: the mount of KITTI's sensor."""
    sweeps: int = 5
    """Number of first sweeps whose median is the estimate. Chosen on: judgement."""
    max_range_m: float = 15.0
    """Farthest cell used [m]: farther ground may be higher or lower. Chosen on: KITTI scans."""
    bin_m: float = 0.05
    """Width of a bin of depths below the sensor [m]; a bin and both neighbours must hold the floor.
    Chosen on: KITTI scans."""
    min_cells: int = 12
    """Fewest flat cells in three neighbouring bins that are a floor. Chosen on: KITTI scans."""
    horizon_beams: float = 2.0
    """Depth of the least deep cell used [beam spacings]. Higher cells may be shelves or tables.
    Chosen on: simulated rooms."""


@dataclass(frozen=True)
class GroundTuning:
    """Tracing of the ground along the rays of the polar grid."""

    noise_m: float = 0.1
    """Greatest residual of a ground return on the plane of its ray [m]. More lifts the ground onto low objects.
    Chosen on: KITTI scans."""
    hidden_m: float = 0.15
    """Depth of the ground below the lowest return of something whose foot is hidden by a crest [m]. More keeps the
    lowest returns of people there, and takes more of the ground for them. Chosen on: simulated hills and stairs."""
    near_m: float = 1.5
    """Greatest distance over which ground may rise by `max_slope_deg` between two ground cells of a ray [m].
    More takes flanks of cars for ground. Chosen on: KITTI scans."""
    max_gap_m: float = 6.0
    """Value of `near_m` on and beside a ramp, and distance over which the slope of a ray is extrapolated [m].
    Chosen on: simulated ramps."""
    ramp_share: float = 0.27
    """Share of `max_slope_deg` above which the running slope of a ray is a ramp. Chosen on: simulated ramps."""
    slope_length_m: float = 3.0
    """Length over which the running slope of a ray is a mean [m]: the slope between two ground cells at this distance
    weighs as much as all before. Less lets the noise of close returns into the slope, more is late on ramps.
    Chosen on: KITTI scans, simulated hills and ramps."""
    bonnet_range_m: float = 11.0
    """Range from which the next ring is looked at for what stands behind a low return [m]: cells are as deep as a
    bonnet, 1 m, there. Chosen on: sensor study (far cars of a VLP-16)."""
    flank_sectors: int = 3
    """Sectors to the left and right of a ray whose median bounds its surface. Chosen on: KITTI scans."""
    flank_m: float = 0.25
    """Height above the median across `flank_sectors` from which a surface is the side of a vehicle [m].
    Chosen on: KITTI scans."""
    rings_behind: int = 8
    """Rings behind a cell in which a rise goes on, or comes down again, on a ray that has met no ground before. Less
    takes low things nearer than all visible ground for ground, more takes hills for things.
    Chosen on: simulated clutter and hills."""
    low_m: float = 0.08
    """Height above the median of the surface beside it from which a surface is the top of a low thing [m].
    More takes people who lie for ground. Chosen on: simulated halls."""
    low_half_width_m: float = 1.2
    """Distance to the left and right of a ray at which the median for `low_m` is taken [m]. Less takes people who lie
    for ground. Chosen on: simulated halls."""
    low_range_m: float = 15.0
    """Range up to which low returns and the tops of low things are looked for, and the ground may rise on a ray that
    has met none before [m]. More finds more feet and costs time.
    Chosen on: simulated halls."""
    clear_m: float = 0.06
    """Height above the roughness of the ground from which a return is clear of it [m]. Less finds things in rough
    ground that are not there. Chosen on: simulated lawns, hills and halls."""
    foot_share: float = 0.6
    """Share of the height from which a return is clear of the ground; returns from this share on may be its foot.
    Less takes ground for feet. Chosen on: simulated people."""
    min_foot_m: float = 0.03
    """Least height of a foot above the ground [m]. Chosen on: the range noise of common sensors."""


@dataclass(frozen=True)
class CeilingTuning:
    """The ceiling of a room, below which objects end. Heights are above the ground."""

    lowest_m: float = 1.85
    """Least height of a ceiling [m]. Less cuts heads, more misses the ceilings of car parks.
    Chosen on: simulated car parks."""
    min_cells: int = 50
    """Fewest polar cells with returns above `lowest_m` under a ceiling. Chosen on: judgement."""
    min_share: float = 0.4
    """Share of the polar cells with returns above `lowest_m` whose top has to continue that of the cell before on its
    ray. Less cuts shelves, hedges and lorries, more misses the vaults of narrow passages. Chosen on: greatest share
    without a ceiling, of simulated streets, yards and real scans, .36; least share of a narrow vault, .41."""
    step_m: float = 0.1
    """Difference in height below which a top continues the one before [m]. More takes trees for a ceiling.
    Chosen on: simulated rooms, streets and forests."""
    grazed_m: float = 0.4
    """Distance above `max_height_m` up to which a ceiling is looked for [m]: lower returns of it are used.
    Chosen on: simulated halls."""
    clearance_m: float = 0.1
    """Distance below a ceiling within which returns belong to it [m]. Chosen on: simulated car parks."""
    fixture_m: float = 0.5
    """Distance below a ceiling up to which pipes, lamps and beams above `head_m` belong to it [m].
    More cuts vans. Chosen on: simulated car parks."""
    head_m: float = 1.9
    """Height that hardly anybody exceeds [m]. Less cuts heads, more leaves beams. Chosen on: simulated car parks."""


@dataclass(frozen=True)
class CellTuning:
    """Connection of neighbouring cells."""

    max_gap_m: float = 0.3
    """Vertical gap below which neighbouring cells are connected [m], to which `max_gap_beams` is added. More joins
    people with what hangs above them. Chosen on: KITTI scans."""
    max_gap_beams: float = 2.0
    """Growth of `max_gap_m` [beam spacings at the range of the cell]. Less divides objects that few beams meet.
    Chosen on: KITTI scans."""


@dataclass(frozen=True)
class PorosityTuning:
    """Returns from the air. Chosen on: simulated crowds and yards in fog, dust and snow, and streets in clear air."""

    min_solidity: float = 0.2
    """Share of the rays through a window that end there, below which the window is not solid. More takes edges and
    thin things for air, less leaves dense fog."""
    reach_m: float = 0.15
    """Least distance below and above a point up to which its window reaches [m]."""
    reach_beams: float = 1.5
    """`reach_m` in beam spacings at the range of the point; the greater of both counts."""
    point_range_m: float = 7.0
    """Range up to which single points are looked at [m]. More takes people behind dust for dust, less leaves fog
    above heads."""
    max_sweep_share: float = 0.3
    """Share of airborne returns among those above ground, above which the air is full. Less takes woods and hedges
    for fog, more leaves dust on what it touches."""
    min_air_rays: float = 0.005
    """Share of the rays of a direction that end in the air, from which the air is full there. Less takes leaves for
    fog, more leaves flakes above heads."""
    min_directions: float = 0.75
    """Share of the directions in view in which the air must be full (`min_air_rays`) for all of it to be. Less
    takes hedges and woods on both sides for fog, more misses fog between walls."""
    min_cluster_solidity: float = 0.24
    """Mean solidity of its returns from which a cluster can be an object. More takes people in fog for fog."""
    max_range_m: float = 15.0
    """Range up to which returns of the air are looked for [m]; farther away, fog and flakes return too little."""


@dataclass(frozen=True)
class SplitTuning:
    """Split of a person off a cluster that holds a person and more."""

    person: PersonSize = SPLIT_PERSON
    """Size of a part that is split off."""
    hidden_person: PersonSize = HIDDEN_PERSON
    """Size of a part that is split off if it stands behind a surface."""
    min_extent_m: float = 0.8
    """Extent above which a cluster may hold a person and more [m]. Less divides single people.
    Chosen on: sensor study."""
    min_cell_returns: float = 0.9
    """Least width of a fine cell [spacings of the returns]; narrower ones split objects.
    Chosen on: sensor study."""
    min_points: int = 8
    """Points below which a part is not split off. Chosen on: sensor study."""


@dataclass(frozen=True)
class HeadTuning:
    """People side by side, or behind a load, in one cluster.

    Chosen on: simulated pairs, groups, trolleys and pushchairs, with a check on simulated streets.
    """

    min_extent_m: float = 1.0
    """Extent of a cluster from which heads are looked for [m]. Less divides people in stride."""
    max_extent_m: float = 3.0
    """Greatest extent of a cluster in which heads are looked for [m]. More costs time, and divides hedges."""
    max_range_m: float = 10.0
    """Range of a cluster up to which heads are looked for [m]. More divides cars, whose roofs few points meet."""
    min_top_m: float = 1.35
    """Least height of a head [m]. Less takes handlebars for heads."""
    max_top_m: float = 2.2
    """Greatest height of a head [m]. Beside what is higher, a column or a wall, one person is found too. Less divides
    trees. Chosen on: people at columns of a hall, with a check on an orchard."""
    reach_m: float = 0.43
    """Distance to the head within which cells belong to a person [m]. More adds the handle of what is pushed, and the
    person is taken for a cyclist."""
    max_apart_m: float = 1.5
    """Distance of two heads beyond which heights need not dip between them [m]."""
    min_dip_m: float = 0.15
    """Least dip between two heads [m]. More misses groups that few beams meet."""
    head_height_m: float = 0.3
    """Height of a head [m]: cells that reach into it are the head."""
    max_head_m: float = 0.55
    """Greatest extent of a head [m]. More takes roofs of cars for heads."""
    shoulders_m: float = 0.4
    """Height from the top of a head down to the shoulders [m]. More takes goods beside a post for shoulders."""
    min_shoulders_m: float = 0.25
    """Least extent of head and shoulders [m]; what has less is a post. With less, the posts of stalls are people.
    With more, people seen from the side lose their arms. Chosen on: simulated stalls, with a check on pairs."""
    post_reach_m: float = 0.2
    """Distance to a post within which cells belong to it [m]. More adds goods, and the post is taken for a person."""
    max_bottom_m: float = 0.45
    """Greatest height of the bottom of a person [m]. More divides treetops."""
    min_points: int = 20
    """Points below which a person, or a load, is not one. Less divides what is far away."""
    load_m: float = 0.65
    """Distance to the head from which something is a load [m]. Less takes the front of a bicycle for one."""
    min_load_top_m: float = 0.85
    """Least height of the top of a load [m]. Less takes the front wheel of a bicycle for one."""


@dataclass(frozen=True)
class StructureTuning:
    """Long surfaces within clusters, and the parts before them that leave.

    Chosen on: simulated walls, doors, car parks and hedges, with a check on simulated streets.
    """

    min_extent_m: float = 2.5
    """Extent of a cluster from which surfaces are looked for [m]. Less costs time."""
    max_range_m: float = 20.0
    """Range of a cluster up to which surfaces are looked for [m]. More costs time."""
    oversized_m: float = 9.0
    """Extent of a cluster from which it is divided into its parts on the fine grid, and loses all that stands out
    before its surfaces [m]; smaller ones lose possible people only."""
    max_lines: int = 6
    """Greatest number of surfaces of a cluster."""
    max_cells: int = 32
    """Cells of a cluster that vote for a line. More costs time."""
    min_cells: int = 12
    """Cells without a surface below which no further one is looked for."""
    min_base_m: float = 0.5
    """Least distance of two cells whose line is tried [m]."""
    refinements: int = 2
    """Number of least-squares fits of a line to the cells near it."""
    thickness_m: float = 0.1
    """Distance from a line within which a cell is on it [m]. More swallows people who lean on a wall."""
    max_gap_m: float = 1.5
    """Greatest gap within a run of cells along a line [m]: people hide a part of the wall."""
    min_length_m: float = 2.0
    """Least length of a run of cells that is a surface [m]. More keeps people joined to short walls."""
    min_filled: float = 0.5
    """Least share of a run that is not gaps. Less takes rows of poles for walls."""
    piece_gap: float = 1.6
    """Gap between two pieces of a run [lengths of a cell]. More keeps people in doorways joined to the wall."""
    min_piece_m: float = 0.8
    """Least length of a piece that is surface [m]; a person in a doorway is a shorter one."""
    beside_m: float = 0.6
    """Distance beyond the ends of a run up to which things are before or behind it [m]."""
    min_before_m: float = 0.35
    """Least distance that a part reaches before a surface [m]. Less takes bulges of hedges for people."""
    max_behind_m: float = 0.4
    """Greatest distance that a part which leaves reaches behind the surface [m]. More takes cars apart, whose
    seats lie behind their sides."""
    min_across_m: float = 0.2
    """Least distance that a part reaches across a surface, from front to back [m]: a person in a doorway."""
    max_bottom_m: float = 0.8
    """Greatest height of the bottom of a possible person before a surface [m]. More takes pillars of cars for
    people."""
    max_hidden_m: float = 1.5
    """Greatest distance behind a surface of a person whom it hides in part [m]."""
    min_above_m: float = 0.25
    """Least height above the surfaces of a person whom they hide in part [m]. Less takes seats of cars for people."""
    min_part_extent_m: float = 0.2
    """Least extent of a part that stands out and is no possible person [m]. Less takes posts of fences."""
    hanging_m: float = 1.6
    """Least height of a cell that hangs above the ground [m]: a beam, a branch."""
    min_hanging: float = 0.3
    """Share of hanging cells from which a cluster is a canopy. Its hanging cells join nothing below."""


@dataclass(frozen=True)
class OverhangTuning:
    """People below something that hangs. Chosen on: posed crowns, awnings and lintels, with a check on streets."""

    max_range_m: float = 10.0
    """Range of a cluster up to which people below it are looked for [m]. More takes shrubs below trees for people."""
    min_top_m: float = 1.95
    """Least height of the top of a cluster in which people stand below what hangs [m]. Less costs time."""
    gap_m: float = 0.2
    """Least height of a gap [m]. More keeps people joined to what hangs right above them."""
    gap_beams: float = 1.5
    """Least height of a gap in spacings of the beams; the greater of both counts. Less takes spacings for gaps."""
    max_gap_m: float = 0.6
    """Gap from which on the beams are too far apart to show one [m]."""
    first_level: int = 10
    """Lowest level of height at which a gap begins: that of a child's head."""
    last_level: int = 22
    """Highest level of height at which a gap begins: that of a tall person's head."""
    min_share: float = 0.2
    """Least share of a person's cells below a gap. Less takes shrubs beside a crown for people."""
    max_person_m: float = 2.0
    """Greatest height of a person below what hangs [m]. More takes trunks for people."""
    min_points: int = 20
    """Points from which a part below a gap may be a person. Less takes twigs for people."""


@dataclass(frozen=True)
class ClusterTuning:
    """Clusters that are kept although they are low, or parts of an oversized one."""

    min_line_points: int = 15
    """Points from which a cluster lower than `min_height_m` is kept: one beam meets an object.
    Chosen on: sensor study."""
    min_line_top_m: float = 0.5
    """Height of the top of a cluster that one beam meets above the ground [m]; lower ones are kerbs.
    Chosen on: sensor study."""
    min_part_points: int = 15
    """Points from which a part of an oversized cluster is kept. Chosen on: KITTI scans."""
    min_part_top_m: float = 0.9
    """Height of the top of a part of an oversized cluster above the ground [m]; lower ones are pieces of hedges.
    Chosen on: KITTI scans."""


@dataclass(frozen=True)
class LowTuning:
    """Things lower than `clearance_m`, and feet of what is higher."""

    min_points: int = 8
    """Least number of points of a low thing. Less makes proposals that come and go. Chosen on: simulated halls."""
    max_range_m: float = 15.0
    """Range up to which tall points that are too few or too low belong to low things [m], that of the low points.
    Chosen on: simulated halls."""
    max_extent_m: float = 3.0
    """Greatest extent of a low thing that is a proposal [m]; longer ones are kerbs. Chosen on: judgement."""
    max_foot_m: float = 0.6
    """Extent up to which all of a low group beside something tall is its foot [m]. Chosen on: judgement."""
    sparse_top_m: float = 0.25
    """Height from which a group of few points is above the ground [m]; lower ones are rough ground.
    Chosen on: judgement."""
    sparse_range_m: float = 3.0
    """Range up to which the smallest low group is above the ground [m]. Chosen on: judgement."""


@dataclass(frozen=True)
class StripTuning:
    """Strips that make one car, and that car. Few beams show a rear and, above and behind it, a strip of roof."""

    person: PersonSize = STRIP_PERSON
    """Size of a strip that may be a person and is not merged; its extent is the width across the ray."""
    hidden_person: PersonSize = HIDDEN_PERSON
    """Size of the farther strip if it may be a person whom the nearer one hides."""
    max_hidden_range_m: float = 20.0
    """Range up to which the farther strip may be a person whom the nearer one hides [m]. More takes the roofs of far
    cars off, which few returns meet."""
    min_points: int = 2
    """Least number of points of a strip. Chosen on: KITTI scans thinned to fewer beams, as the values below."""
    visible_m: float = 1.5
    """Height of a car [m], for the number of beams on it."""
    max_beams: float = 8.0
    """Beams on a car from which it is one cluster and no strip."""
    max_diagonal_m: float = 6.0
    """Greatest diagonal from above of a strip and of the car [m]. More merges two cars in a row."""
    min_width_m: float = 0.7
    """Least width of the car across the ray [m]. Less merges poles and people."""
    max_width_m: float = 5.2
    """Greatest width of the car across the ray [m]."""
    min_top_m: float = 0.8
    """Least height of the car's top above the ground [m]."""
    max_top_m: float = 2.2
    """Greatest height of a strip's and the car's top above the ground [m]. More merges walls."""
    max_bottom_m: float = 0.8
    """Greatest height of the car's bottom above the ground [m]."""
    max_gap_m: float = 1.8
    """Greatest distance in range between two strips [m], the length of a bonnet."""
    min_gap_beams: float = -1.0
    """Least distance in elevation from the nearer strip to the farther one [beam spacings]; below 0 they overlap."""
    max_gap_beams: float = 2.0
    """Greatest distance in elevation from the nearer strip to the farther one [beam spacings]."""


@dataclass(frozen=True)
class SupportTuning:
    """People who stand on a platform, whose top is no ground.

    Chosen on: simulated platforms, with a check on simulated streets and on KITTI scans.
    """

    person: PersonSize = RAISED_PERSON
    """Size of a proposal that may be a person on a platform."""
    min_step_m: float = 0.3
    """Least height above the ground of the lowest point of a person on a platform [m]. Lower ones hardly matter."""
    max_step_m: float = 1.15
    """Greatest height above the ground of the lowest point of a person on a platform [m], whose edge hides feet. More
    takes signs for people."""
    min_points: int = 20
    """Points from which a proposal may be a person on a platform. Less takes far poles and branches for people."""


@dataclass(frozen=True)
class ViewTuning:
    """Edge of a limited field of view. Chosen on: KITTI scans within the camera's view."""

    margin_m: float = 6.0
    """Distance outside the view up to which points are segmented [m], so that objects across the edge are whole."""
    in_view_m: float = 1.0
    """Distance outside the view up to which a proposal is kept [m]."""
    truncation_m: float = 0.3
    """Distance from the end of the margin within which a proposal is cut there [m]."""


@dataclass(frozen=True)
class HeadingTuning:
    """Heading of a box by the closeness of its sides to the cells."""

    max_cells: int = 32
    """Cells of a proposal that decide on its heading. More costs time. Chosen on: KITTI scans."""
    side_noise_m: float = 0.1
    """Distance within which a cell lies on a side [m]. Chosen on: KITTI scans; models are trained with this value."""


@dataclass(frozen=True)
class ViewEndTuning:
    """Sides of a proposal that end where the view of the sensor ends."""

    beam_steps: float = 0.75
    """Distance to the outermost beam within which a proposal is cut [beam spacings]. Chosen on: simulated people."""
    near_m: float = 0.1
    """Distance beyond `min_range_m` within which a proposal is cut at the nearest range [m]. Chosen on: judgement."""
    tilted_m: float = 8.0
    """Greatest distance at which a tilted sensor cuts [m]: the models of what is cut know nothing farther away.
    Chosen on: the training data of those models."""


@dataclass(frozen=True)
class JoiningTuning:
    """Proposals of several sensors that are one object."""

    cell_m: float = 0.12
    """Side of the cells in which or beside which two sensors see the same [m]. Less leaves two proposals of an object
    that they see from two sides; more joins what stands side by side. Chosen on: simulated yards."""
    gap_m: float = 0.3
    """Greatest gap in height between the parts of an object that two sensors see [m]. Chosen on: judgement."""


@dataclass(frozen=True)
class SegmentationTuning:
    """All values of the stage."""

    polar: PolarGridTuning = PolarGridTuning()
    sensor_height: SensorHeightTuning = SensorHeightTuning()
    ground: GroundTuning = GroundTuning()
    ceiling: CeilingTuning = CeilingTuning()
    cells: CellTuning = CellTuning()
    porosity: PorosityTuning = PorosityTuning()
    split: SplitTuning = SplitTuning()
    clusters: ClusterTuning = ClusterTuning()
    low: LowTuning = LowTuning()
    structure: StructureTuning = StructureTuning()
    overhang: OverhangTuning = OverhangTuning()
    heads: HeadTuning = HeadTuning()
    strips: StripTuning = StripTuning()
    support: SupportTuning = SupportTuning()
    view: ViewTuning = ViewTuning()
    heading: HeadingTuning = HeadingTuning()
    view_ends: ViewEndTuning = ViewEndTuning()
    joining: JoiningTuning = JoiningTuning()
