/* Boxes of whole objects (object_box/estimator.py).
 *
 * Headings are unit vectors. Cosines, sines and angles come from NumPy, so that both implementations share their
 * rounding.
 */
#include "kernels.h"

enum { UNKNOWN, STILL, MOVING }; /* MotionState */

static const double COS_45 = 0x1.6a09e667f3bcdp-1;
static const double MIN_RANGE_M2 = 1e-6, UNKNOWN_RAD2 = 1e6;

/* Columns of the track table: those of ObjectBoxes, which are written, and those of the tracker and the decision. */
typedef struct {
    double (*whole_box)[7] SHAPE(m, 7);
    double (*heading)[2], (*centre_offset)[2] SHAPE(m, 2);
    double (*known_m)[3] SHAPE(m, 3);
    double *heading_variance, *axis_evidence SHAPE(m);
    uint8_t *heading_known, *estimated SHAPE(m);
    const double (*box)[7] SHAPE(m, 7);
    const double (*x)[4], (*velocity_covariance)[4] SHAPE(m, 4);
    const double (*velocity)[2], (*neighbour)[2] SHAPE(m, 2); /* headings of neighbours (WholeBoxes._neighbours) */
    const double *moved_m SHAPE(m);
    const i64 *proposal, *motion, *object_class SHAPE(m);
    i64 m;
} ObjectBoxColumns;

/* The proposals of a frame [sensor], and the pose of the sensor: rows of the rotation and place [world]. */
typedef struct {
    const i64 *offsets SHAPE(n_offsets);
    const float *coordinates[3] SHAPE(3, n_points);
    const double (*box)[7] SHAPE(n, 7);
    const double (*centroid)[3] SHAPE(n, 3);
    const double *ground_z_m SHAPE(n); /* infinite where not known */
    const double (*T_world_sensor)[4] SHAPE(4, 4);
    i64 n;
    double forward_x, forward_y;
} VisibleProposals;

/* Unit vectors of the headings at which rectangles are fitted, and the sides at these: x and y of the headings, then of
 * what lies to the left of them. */
typedef struct {
    const double (*heading)[2] SHAPE(n, 2);
    const float *sides[2] SHAPE(2, n_sides);
    i64 n;
} FitHeadings;

/* Sizes of the classes, and whether they are people. */
typedef struct {
    const double (*usual_m)[3], (*spread_m)[3] SHAPE(n_classes, 3);
    const double (*max_m)[2] SHAPE(n_classes, 2);
    const uint8_t *is_person, *is_walker SHAPE(n_classes);
    i64 n_classes;
} ClassSizes;

/* object_box.tuning.HeadingTuning */
typedef struct {
    i64 max_fit_points;
    double side_noise_m, initial_sigma_rad, drift_sigma_rad, fit_sigma_rad, min_side_m, full_side_m, least_fit_weight;
    double person_fit_weight, pedestrian_fit_weight, motion_sigma_rad, min_speed_mps, min_moved_m, evidence_memory;
    double max_evidence, moving_evidence, turning_evidence, whole_side_evidence, axis_spread_m, max_frame_evidence;
    double shoulder_ratio, across_evidence, neighbour_evidence;
} HeadingTuning;

/* object_box.tuning.SizeTuning */
typedef struct {
    double growth, shrinkage, doubt, length_noise_m, width_noise_m, height_noise_m, stride_m;
} SizeTuning;

/* object_box.tuning.CentreTuning */
typedef struct {
    double gain, pedestrian_depth_m, cyclist_depth_m, slack_m, min_reach_m;
} CentreTuning;

typedef struct {
    double x, y;
} Vector;

static Vector left_of(Vector a) { return (Vector){-a.y, a.x}; }
static double dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y; }
static Vector scaled(double factor, Vector a) { return (Vector){factor * a.x, factor * a.y}; }
static double clip(double a, double low, double high) { return mind(maxd(a, low), high); }

/* estimator._turned: the heading of a row after a measured one */
static void turn(const ObjectBoxColumns *tracks, i64 row, double variance, Vector measured, double measured_variance)
{
    double *heading = tracks->heading[row], gain = variance / (variance + measured_variance);
    Vector turned = {heading[0] + gain * (measured.x - heading[0]), heading[1] + gain * (measured.y - heading[1])};
    double length = __builtin_sqrt(dot(turned, turned));
    heading[0] = turned.x / length;
    heading[1] = turned.y / length;
    tracks->heading_variance[row] = (1 - gain) * variance;
}

/* estimator.WholeBoxes._axis_evidence, of a side along an axis */
static double likelihood(double side_m, int axis, const double *usual_m, const double *spread_m,
                         const HeadingTuning *tuning)
{
    double variance = spread_m[axis] * spread_m[axis] + tuning->axis_spread_m * tuning->axis_spread_m;
    double off = side_m - usual_m[axis], square = off * off / variance, part = 1 + square / 3;
    return off > 0 ? tuning->whole_side_evidence - square / 2 : tuning->whole_side_evidence / (part * part);
}

static double axis_evidence(double length_m, double width_m, i64 class, const ClassSizes *sizes,
                            const HeadingTuning *tuning)
{
    const double *usual_m = sizes->usual_m[class], *spread_m = sizes->spread_m[class];
    if (sizes->is_walker[class])
        return -tuning->across_evidence * (double)(length_m > tuning->shoulder_ratio * width_m);
    double ratio = likelihood(length_m, 0, usual_m, spread_m, tuning)
                   + likelihood(width_m, 1, usual_m, spread_m, tuning)
                   - likelihood(width_m, 0, usual_m, spread_m, tuning)
                   - likelihood(length_m, 1, usual_m, spread_m, tuning);
    return clip(ratio, -tuning->max_frame_evidence, tuning->max_frame_evidence);
}

/* estimator.WholeBoxes._evidence_of_neighbours */
static double evidence_of_neighbour(Vector neighbour, Vector side, const HeadingTuning *tuning)
{
    double along = dot(neighbour, side);
    return tuning->neighbour_evidence * (2 * along * along - dot(neighbour, neighbour));
}

/* estimator.WholeBoxes._fit_variance */
static double fit_variance(const double sides_m[2], i64 class, const ClassSizes *sizes, const HeadingTuning *tuning)
{
    double weight = clip((sides_m[0] - tuning->min_side_m) / tuning->full_side_m, tuning->least_fit_weight, 1.0);
    weight *= sizes->is_person[class] ? tuning->person_fit_weight : 1.0;
    if (sizes->is_walker[class])
        weight = tuning->pedestrian_fit_weight;
    double excess = maxd(sides_m[1] - sizes->usual_m[class][1], 0.0) / sizes->spread_m[class][1];
    return tuning->fit_sigma_rad * tuning->fit_sigma_rad * (1 + excess * excess) / weight;
}

/* estimator.WholeBoxes._fit: the longer side of the rectangle fitted to a proposal, and both its sides */
static Vector fitted_side(const VisibleProposals *seen, i64 proposal, const FitHeadings *fit,
                          const HeadingTuning *tuning, double sides_m[2])
{
    const float *const *xyz = seen->coordinates;
    const i64 *offsets = &seen->offsets[proposal];
    float low[2], high[2];
    i64 best;
    modt_best_headings(xyz[0], xyz[1], NULL, offsets, 1, tuning->max_fit_points, fit->sides[0], fit->sides[1],
                       (i32)fit->n, (float)tuning->side_noise_m, &best);
    Vector side = {fit->heading[best][0], fit->heading[best][1]};
    extent_at(xyz, offsets[0], offsets[1], side.x, side.y, low, high);
    double along_m = (double)high[0] - (double)low[0], across_m = (double)high[1] - (double)low[1];
    if (along_m < across_m)
        side = left_of(side);
    sides_m[0] = maxd(along_m, across_m);
    sides_m[1] = mind(along_m, across_m);
    return (Vector){side.x * seen->forward_x - side.y * seen->forward_y,
                    side.x * seen->forward_y + side.y * seen->forward_x};
}

/* estimator.WholeBoxes._turn_to_fit */
static void turn_to_fit(const ObjectBoxColumns *tracks, i64 row, Vector side, double evidence, double measured,
                        const HeadingTuning *tuning)
{
    Vector heading = {tracks->heading[row][0], tracks->heading[row][1]};
    double facing = dot(heading, side), beside = dot(heading, left_of(side));
    int is_long = __builtin_fabs(facing) >= __builtin_fabs(beside);
    double sign = (is_long ? facing : beside) < 0 ? -1.0 : 1.0;
    double counted = tuning->evidence_memory * tracks->axis_evidence[row] + (is_long ? evidence : -evidence);
    tracks->axis_evidence[row] = clip(counted, -tuning->max_evidence, tuning->max_evidence);
    double variance = tracks->heading_variance[row] + tuning->drift_sigma_rad * tuning->drift_sigma_rad;
    turn(tracks, row, variance, scaled(sign, is_long ? side : left_of(side)), measured);
}

/* estimator.WholeBoxes._moving */
static int is_moving(const ObjectBoxColumns *tracks, i64 row, const HeadingTuning *tuning)
{
    Vector velocity = {tracks->velocity[row][0], tracks->velocity[row][1]};
    int fast = dot(velocity, velocity) > tuning->min_speed_mps * tuning->min_speed_mps;
    int went = tracks->moved_m[row] > tuning->min_moved_m && tracks->motion[row] == UNKNOWN;
    return fast && (went || tracks->motion[row] == MOVING);
}

/* estimator.WholeBoxes._turn_to_motion */
static void turn_to_motion(const ObjectBoxColumns *tracks, i64 row, const HeadingTuning *tuning)
{
    Vector velocity = {tracks->velocity[row][0], tracks->velocity[row][1]};
    const double *covariance = tracks->velocity_covariance[row];
    double *heading = tracks->heading[row], square = dot(velocity, velocity), length = __builtin_sqrt(square);
    Vector ahead = {velocity.x / length, velocity.y / length};
    double across = ahead.y * ahead.y * covariance[0] - 2 * ahead.x * ahead.y * covariance[1]
                    + ahead.x * ahead.x * covariance[3];
    if (dot((Vector){heading[0], heading[1]}, ahead) < 0 && !tracks->heading_known[row]) {
        heading[0] *= -1.0;
        heading[1] *= -1.0;
    }
    int elsewhere = dot((Vector){heading[0], heading[1]}, ahead) < COS_45;
    double measured = tuning->motion_sigma_rad * tuning->motion_sigma_rad + across / square;
    turn(tracks, row, elsewhere ? UNKNOWN_RAD2 : tracks->heading_variance[row], ahead, measured);
    tracks->axis_evidence[row] = tuning->moving_evidence;
    tracks->heading_known[row] = 1;
}

/* estimator.WholeBoxes._turn */
static void turn_row(const ObjectBoxColumns *tracks, i64 row, Vector side, const double sides_m[2], int moving,
                     const ClassSizes *sizes, const HeadingTuning *tuning)
{
    const i64 class = tracks->object_class[row];
    const Vector neighbour = {tracks->neighbour[row][0], tracks->neighbour[row][1]};
    double *heading = tracks->heading[row], evidence = axis_evidence(sides_m[0], sides_m[1], class, sizes, tuning);
    evidence += evidence_of_neighbour(neighbour, side, tuning);
    if (!tracks->estimated[row]) {
        Vector first = evidence >= 0 ? side : left_of(side);
        heading[0] = first.x;
        heading[1] = first.y;
        tracks->heading_variance[row] = tuning->initial_sigma_rad * tuning->initial_sigma_rad;
    }
    turn_to_fit(tracks, row, side, evidence, fit_variance(sides_m, class, sizes, tuning), tuning);
    if (moving) {
        turn_to_motion(tracks, row, tuning);
    } else if (tracks->axis_evidence[row] < -tuning->turning_evidence) {
        double *known_m = tracks->known_m[row], x = heading[0], length_m = known_m[0];
        heading[0] = -heading[1];
        heading[1] = x;
        tracks->axis_evidence[row] *= -1.0;
        tracks->heading_known[row] = 0;
        known_m[0] = known_m[1];
        known_m[1] = length_m;
    }
}

/* estimator.WholeBoxes._size */
static void estimate_size(const ObjectBoxColumns *tracks, i64 row, const double extent_m[3], int moving,
                          const ClassSizes *sizes, const SizeTuning *tuning, double size_m[3])
{
    const i64 class = tracks->object_class[row];
    const double noise_m[3] = {tuning->length_noise_m, tuning->width_noise_m, tuning->height_noise_m};
    int merged = extent_m[0] > sizes->max_m[class][0] || extent_m[1] > sizes->max_m[class][1];
    for (int k = 0; k < 3; k++) {
        double *known_m = &tracks->known_m[row][k], change_m = extent_m[k] - *known_m;
        double share = change_m > 0 ? tuning->growth : tuning->shrinkage;
        *known_m += (!tracks->estimated[row] ? 1.0 : merged ? 0.0 : share) * change_m;
        double usual_m = sizes->usual_m[class][k], spread_m = sizes->spread_m[class][k];
        if (k == 0)
            usual_m += tuning->stride_m * (double)(moving && sizes->is_walker[class]);
        double more_m = *known_m - usual_m, missing = maxd(-more_m, 0.0) / spread_m, part = 1 + missing * missing;
        double whole = 1 / (1 + tuning->doubt * (part * part));
        double trust = spread_m * spread_m / (spread_m * spread_m + noise_m[k] * noise_m[k]);
        double at_least_m = maxd(more_m, 0.0);
        size_m[k] = usual_m + (at_least_m + whole * (trust * more_m - at_least_m));
    }
}

/* estimator._in_world */
static Vector in_world(const VisibleProposals *seen, i64 proposal, const double *box, Vector position)
{
    const double(*T)[4] = seen->T_world_sensor, x = position.x - seen->box[proposal][0];
    const double y = position.y - seen->box[proposal][1];
    return (Vector){box[0] + (T[0][0] * x + T[0][1] * y), box[1] + (T[1][0] * x + T[1][1] * y)};
}

/* estimator.WholeBoxes._centre, of which this is the place that a frame speaks for along an axis, from the middle of
 * the visible part, and the greatest distance from it */
static double follow(double wanted, double former, double room_m, int estimated, const CentreTuning *tuning)
{
    return clip(estimated ? former + tuning->gain * (wanted - former) : wanted, -room_m, room_m);
}

static void estimate_centre(const ObjectBoxColumns *tracks, i64 row, const VisibleProposals *seen, Vector middle,
                            const double extent_m[3], const double size_m[3], const ClassSizes *sizes,
                            const CentreTuning *tuning)
{
    const i64 class = tracks->object_class[row], proposal = tracks->proposal[row];
    const double *x = tracks->x[row];
    double *offset = tracks->centre_offset[row];
    Vector heading = {tracks->heading[row][0], tracks->heading[row][1]};
    Vector former = {x[0] + offset[0] - middle.x, x[1] + offset[1] - middle.y}, wanted;
    Vector unseen_m = {maxd(size_m[0] - extent_m[0], 0.0) / 2, maxd(size_m[1] - extent_m[1], 0.0) / 2};
    if (sizes->is_person[class]) {
        Vector centroid = {seen->centroid[proposal][0], seen->centroid[proposal][1]};
        double depth_m = sizes->is_walker[class] ? tuning->pedestrian_depth_m : tuning->cyclist_depth_m;
        double share = 1 + depth_m / __builtin_sqrt(maxd(dot(centroid, centroid), MIN_RANGE_M2));
        Vector body = in_world(seen, proposal, tracks->box[row], scaled(share, centroid));
        Vector step = {body.x - middle.x, body.y - middle.y};
        wanted = (Vector){dot(heading, step), dot(left_of(heading), step)};
    } else {
        Vector ray = {middle.x - seen->T_world_sensor[0][3], middle.y - seen->T_world_sensor[1][3]};
        double reach_x = maxd(size_m[0] / 2, tuning->min_reach_m), reach_y = maxd(size_m[1] / 2, tuning->min_reach_m);
        wanted.x = clip(dot(heading, ray) / reach_x, -1.0, 1.0) * unseen_m.x;
        wanted.y = clip(dot(left_of(heading), ray) / reach_y, -1.0, 1.0) * unseen_m.y;
    }
    const int estimated = tracks->estimated[row];
    double u = follow(wanted.x, dot(heading, former), unseen_m.x + tuning->slack_m, estimated, tuning);
    double v = follow(wanted.y, dot(left_of(heading), former), unseen_m.y + tuning->slack_m, estimated, tuning);
    double *box = tracks->whole_box[row];
    box[0] = middle.x + (heading.x * u - heading.y * v);
    box[1] = middle.y + (heading.y * u + heading.x * v);
    offset[0] = box[0] - x[0];
    offset[1] = box[1] - x[1];
}

/* estimator.WholeBoxes._estimate: the columns of all tracks but the yaw of the objects in view. */
EXPORT void modt_object_boxes(const ObjectBoxColumns *tracks, const VisibleProposals *seen, const FitHeadings *fit,
                              const ClassSizes *sizes, const HeadingTuning *heading_tuning,
                              const SizeTuning *size_tuning, const CentreTuning *centre_tuning)
{
    const double(*T)[4] = seen->T_world_sensor;
    for (i64 row = 0; row < tracks->m; row++) {
        const i64 class = tracks->object_class[row], proposal = tracks->proposal[row];
        const double *box = tracks->box[row];
        double *whole_box = tracks->whole_box[row];
        PROVEN(class >= 0 && class < sizes->n_classes && proposal < seen->n);
        if (class == 0) {
            for (int k = 0; k < 7; k++)
                whole_box[k] = box[k];
            continue;
        }
        if (proposal == NONE) {
            for (int k = 0; k < 2 && tracks->estimated[row]; k++)
                whole_box[k] = tracks->x[row][k] + tracks->centre_offset[row][k];
            continue;
        }
        const int moving = is_moving(tracks, row, heading_tuning);
        double sides_m[2];
        Vector side = fitted_side(seen, proposal, fit, heading_tuning, sides_m);
        turn_row(tracks, row, side, sides_m, moving, sizes, heading_tuning);
        /* The rectangle about the points at the heading. */
        const double *heading = tracks->heading[row], forward_x = seen->forward_x, forward_y = seen->forward_y;
        const double c = heading[0] * forward_x + heading[1] * forward_y;
        const double s = heading[1] * forward_x - heading[0] * forward_y;
        float low[2], high[2];
        extent_at(seen->coordinates, seen->offsets[proposal], seen->offsets[proposal + 1], c, s, low, high);
        double u = ((double)low[0] + (double)high[0]) / 2, v = ((double)low[1] + (double)high[1]) / 2;
        Vector middle = in_world(seen, proposal, box, (Vector){u * c - v * s, u * s + v * c});
        const double *centroid = seen->centroid[proposal];
        double ground_z = T[2][0] * centroid[0] + T[2][1] * centroid[1] + T[2][2] * seen->ground_z_m[proposal] + T[2][3];
        double half_m = box[5] / 2, bottom = mind(box[2] - half_m, ground_z), size_m[3];
        double extent_m[3] = {(double)high[0] - (double)low[0], (double)high[1] - (double)low[1],
                              box[2] + half_m - bottom};
        estimate_size(tracks, row, extent_m, moving, sizes, size_tuning, size_m);
        estimate_centre(tracks, row, seen, middle, extent_m, size_m, sizes, centre_tuning);
        whole_box[2] = bottom + size_m[2] / 2;
        for (int k = 0; k < 3; k++)
            whole_box[3 + k] = size_m[k];
        tracks->estimated[row] = 1;
    }
}
