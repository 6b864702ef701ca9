/* Extents and boxes of groups of points, and pairs of k-DOPs: boxes.py and kdop.py of modt.geometry.
 *
 * A group g has the points from offsets[g] to offsets[g + 1]; none is empty.
 *
 * k-DOPs are eight rows of n numbers: the greatest coordinates along four axes, then along the same axes backwards. Along
 * axis k, k-DOP i reaches from -kdop[(k + 4) * n + i] to kdop[k * n + i]. The axes point east, north-east, north and
 * north-west. */
#include "kernels.h"

typedef float f8 __attribute__((vector_size(32), aligned(4)));
typedef i32 i8 __attribute__((vector_size(32)));
typedef i64 l4 __attribute__((vector_size(32)));

enum { LANES = 8 }; /* points, or k-DOPs, in a vector */
enum { EAST, NORTH_EAST, NORTH, NORTH_WEST, AXES }; /* axes of k-DOPs; AXES more is the same axis backwards */

static const double HALF_ROOT = 0x1.6a09e667f3bcdp-1;    /* component of the axes north-east and north-west */
static const double QUARTER_TURN = 0x1.921fb54442d18p+0; /* radians */

/* Least and greatest coordinates along axes of the points from `begin` to before `end`, at least one. Rows x, y and z
 * of the points are given, and those of the axes. Eight points are taken at a time. The last eight hold some that were
 * taken before, or, where there are fewer in all, the last point several times. */
static ALWAYS_INLINE void extent_along(const float *const xyz[3], i64 begin, i64 end, const float axes[3][AXES],
                                       int n_axes, float *least, float *greatest)
{
    f8 low[AXES], high[AXES], eight[3];
    for (int k = 0; k < n_axes; k++) {
        low[k] = (f8){0} + INFINITY;
        high[k] = -low[k];
    }
    for (i64 next = begin; next < end; next += LANES) {
        i64 i = next + LANES > end && begin + LANES <= end ? end - LANES : next;
        for (int v = 0; v < 3; v++)
            if (i + LANES <= end)
                eight[v] = *(const f8 *)(xyz[v] + i);
            else
                for (i64 lane = 0; lane < LANES; lane++)
                    eight[v][lane] = xyz[v][i + lane < end ? i + lane : end - 1];
        for (int k = 0; k < n_axes; k++) {
            f8 along = axes[0][k] * eight[0] + axes[1][k] * eight[1] + axes[2][k] * eight[2];
            i8 is_less = along < low[k], is_more = along > high[k];
            low[k] = (f8)(((i8)along & is_less) | ((i8)low[k] & ~is_less));
            high[k] = (f8)(((i8)along & is_more) | ((i8)high[k] & ~is_more));
        }
    }
    for (int k = 0; k < n_axes; k++) {
        least[k] = low[k][0];
        greatest[k] = high[k][0];
        for (int lane = 1; lane < LANES; lane++) {
            least[k] = minf(least[k], low[k][lane]);
            greatest[k] = maxf(greatest[k], high[k][lane]);
        }
    }
}

/* Least and greatest coordinates of the points from `begin` to before `end` along a heading, and to the left of it. */
void extent_at(const float *const xyz[3], i64 begin, i64 end, double cosine, double sine, float least[2],
               float greatest[2])
{
    float c = (float)cosine, s = (float)sine;
    float axes[3][AXES] = {{c, -s}, {s, c}, {0.0f, 0.0f}};
    extent_along(xyz, begin, end, axes, 2, least, greatest);
}

/* kdop_ends: k-DOPs (8, n_groups) of groups of points, given the axes (3, 4). */
EXPORT void modt_kdop_ends(const float *x, const float *y, const float *z, const i64 *offsets, i64 n_groups,
                           const float axes[3][AXES], float *kdop)
{
    float low[AXES], high[AXES];
    for (i64 g = 0; g < n_groups; g++) {
        extent_along((const float *[]){x, y, z}, offsets[g], offsets[g + 1], axes, AXES, low, high);
        for (int k = 0; k < AXES; k++) {
            kdop[k * n_groups + g] = high[k];
            kdop[(k + AXES) * n_groups + g] = -low[k];
        }
    }
}

/* upright_boxes: boxes (n_groups, 7) of groups of points, given a heading of each, with its cosine and sine. A box that
 * is wider than long across its heading is turned. */
EXPORT void modt_upright_boxes(const float *x, const float *y, const float *z, const i64 *offsets, i64 n_groups,
                               const double *yaw, const double *cosine, const double *sine, double (*box)[7])
{
    for (i64 g = 0; g < n_groups; g++) {
        float c = (float)cosine[g], s = (float)sine[g];
        float axes[3][AXES] = {{c, -s, 0.0f}, {s, c, 0.0f}, {0.0f, 0.0f, 1.0f}}, low[AXES], high[AXES];
        double middle[3], side[3]; /* along the heading, across it, and upwards */
        extent_along((const float *[]){x, y, z}, offsets[g], offsets[g + 1], axes, 3, low, high);
        for (int k = 0; k < 3; k++) {
            middle[k] = ((double)low[k] + (double)high[k]) / 2;
            side[k] = (double)high[k] - (double)low[k];
        }
        int turned = side[0] < side[1];
        box[g][0] = middle[0] * cosine[g] - middle[1] * sine[g];
        box[g][1] = middle[0] * sine[g] + middle[1] * cosine[g];
        box[g][2] = middle[2];
        box[g][3] = side[turned];
        box[g][4] = side[!turned];
        box[g][5] = side[2];
        box[g][6] = turned ? yaw[g] - QUARTER_TURN : yaw[g];
    }
}

enum { HALVES = 2, BLOCK = LANES * HALVES, SIDES = 4 }; /* k-DOPs compared together, in two vectors */

/* overlapping_pairs: pairs of k-DOPs a (8, n_a) and b (8, n_b) that overlap along x and along y, as indices among both.
 * Returns how many there are; no more than `limit` are written.
 *
 * An end of a has to reach as far as the opposite end of b on each of the four sides. Sixteen of b are compared
 * together in single precision first. That suffices to exclude a pair, since rounding keeps order.
 * Scratch: `reach`, for each block of sixteen of b, the coordinates to be reached on each side. */
EXPORT i64 modt_overlapping_pairs(const double *a, i64 n_a, const double *b, i64 n_b, f8 (*reach)[SIDES][HALVES],
                                  i64 n_blocks, i64 limit, i64 *rows, i64 *columns)
{
    static const int side_row[SIDES] = {EAST, EAST + AXES, NORTH, NORTH + AXES};
    static const int opposite_row[SIDES] = {EAST + AXES, EAST, NORTH + AXES, NORTH};
    i64 count = 0;
    PROVEN(n_blocks * BLOCK >= n_b);
    for (i64 j = 0; j < n_blocks * BLOCK; j++)
        for (int side = 0; side < SIDES; side++) /* nothing reaches beyond the last of b */
            reach[j / BLOCK][side][j / LANES % HALVES][j % LANES] =
                j < n_b ? (float)-b[opposite_row[side] * n_b + j] : __builtin_nanf("");
    for (i64 i = 0; i < n_a; i++) {
        double end[SIDES];
        for (int side = 0; side < SIDES; side++)
            end[side] = a[side_row[side] * n_a + i];
        float east = (float)end[0], west = (float)end[1], north = (float)end[2], south = (float)end[3];
        for (i64 block = 0; block < n_blocks; block++) {
            i8 near[HALVES];
            for (int half = 0; half < HALVES; half++)
                near[half] = (east >= reach[block][0][half]) & (west >= reach[block][1][half]) &
                             (north >= reach[block][2][half]) & (south >= reach[block][3][half]);
            l4 any = (l4)(near[0] | near[1]);
            if (!(any[0] | any[1] | any[2] | any[3]))
                continue;
            for (i64 lane = 0; lane < BLOCK; lane++) {
                i64 j = block * BLOCK + lane;
                if (!near[lane / LANES][lane % LANES])
                    continue;
                int overlap = 1;
                for (int side = 0; side < SIDES; side++)
                    overlap &= end[side] >= -b[opposite_row[side] * n_b + j];
                if (!overlap)
                    continue;
                if (count < limit) {
                    rows[count] = i;
                    columns[count] = j;
                }
                count++;
            }
        }
    }
    return count;
}

/* modt.geometry.tuning.ShapeTuning, which says what each member does. */
typedef struct {
    double end_jitter_m, width_softening_m, area_padding_m, agreement_m, disagreement, near_cosine, near_disagreement;
    double end_variance_decay;
} ShapeTuning;

typedef struct {
    const double *kdop SHAPE(8, n); /* [m] */
    const double *log_width SHAPE(4, n);
    const double *bottom, *top, *log_points SHAPE(n);
    i64 n;
} Shapes;

typedef struct {
    double size, overlap, height, points;
} PairWeights;

static inline double difference(double a, double b) { return __builtin_fabs(a - b); }

/* x and y of the sum of the vectors along the four axes, of which the lengths are given. */
static inline double sum_x(const double along[AXES])
{
    return along[EAST] + HALF_ROOT * (along[NORTH_EAST] - along[NORTH_WEST]);
}

static inline double sum_y(const double along[AXES])
{
    return along[NORTH] + HALF_ROOT * (along[NORTH_EAST] + along[NORTH_WEST]);
}

/* Coordinates of a vector along the four axes. */
static inline void along_axes(double x, double y, double along[AXES])
{
    along[EAST] = x;
    along[NORTH_EAST] = HALF_ROOT * (x + y);
    along[NORTH] = y;
    along[NORTH_WEST] = HALF_ROOT * (y - x);
}

/* pair_costs: costs of n_pairs pairs (rows[p], columns[p]) of shapes a and b, and how much of the smaller one is covered.
 * `covariance` (3, a->n) holds xx, xy and yy of the positions of a. The cost lacks half the logarithm of `spread`, the
 * determinant of the covariance over its least, so that NumPy takes the logarithm. */
EXPORT void modt_pair_costs(const Shapes *a, const Shapes *b, const double *covariance, double variance,
                            const i64 *rows, const i64 *columns, i64 n_pairs, const PairWeights *weights,
                            const ShapeTuning *tuning, double *spread, double *cost, double *coverage)
{
    for (i64 pair = 0; pair < n_pairs; pair++) {
        i64 i = rows[pair], j = columns[pair];
        PROVEN(i >= 0 && i < a->n && j >= 0 && j < b->n);
        /* Along each axis: displacement by the end that moved less, widths of both, and of what they have in common. */
        double moved[AXES], width_a[AXES], width_b[AXES], common[AXES], size = 0.0;
        for (int k = 0; k < AXES; k++) {
            double end_a = a->kdop[k * a->n + i], back_a = a->kdop[(k + AXES) * a->n + i];
            double end_b = b->kdop[k * b->n + j], back_b = b->kdop[(k + AXES) * b->n + j];
            double ahead = end_b - end_a, behind = -(back_b - back_a);
            moved[k] = __builtin_fabs(ahead) < __builtin_fabs(behind) ? ahead : behind;
            common[k] = maxd(mind(end_a, end_b) + mind(back_a, back_b) + tuning->area_padding_m, 0.0);
            width_a[k] = end_a + back_a + tuning->area_padding_m;
            width_b[k] = end_b + back_b + tuning->area_padding_m;
            size += difference(b->log_width[k * b->n + j], a->log_width[k * a->n + i]);
        }
        /* Areas in common, of the upright rectangles, and of those at 45 degrees. */
        double overlap[2], covered[2];
        for (int k = 0; k < 2; k++) {
            double area_a = width_a[k] * width_a[k + 2], area_b = width_b[k] * width_b[k + 2];
            double shared = common[k] * common[k + 2];
            overlap[k] = shared / (area_a + area_b - shared);
            covered[k] = shared / mind(area_a, area_b);
        }
        double height = difference(a->top[i], b->top[j]) + difference(a->bottom[i], b->bottom[j]);
        double shape = weights->size * (size / 4) + weights->overlap * (1 - mind(overlap[0], overlap[1]));
        shape += weights->height * height / 2 + weights->points * difference(a->log_points[i], b->log_points[j]);
        /* Squared Mahalanobis distance of the displacement. */
        double xx = covariance[i] + variance, xy = covariance[a->n + i], yy = covariance[2 * a->n + i] + variance;
        double dx = sum_x(moved) / 2, dy = sum_y(moved) / 2;
        double determinant = xx * yy - xy * xy;
        double distance = (yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy) / determinant;
        spread[pair] = determinant / (variance * variance);
        cost[pair] = distance / 2 + shape;
        coverage[pair] = mind(covered[0], covered[1]);
    }
}

/* coverage: share of k-DOP rows[p] of a (8, n_a) that columns[p] of b (8, n_b) covers, for each pair p. */
EXPORT void modt_coverage(const double *a, i64 n_a, const double *b, i64 n_b, const i64 *rows, const i64 *columns,
                          i64 n_pairs, const ShapeTuning *tuning, double *coverage)
{
    double jitter_m = tuning->end_jitter_m;
    for (i64 pair = 0; pair < n_pairs; pair++) {
        double share[AXES];
        i64 i = rows[pair], j = columns[pair];
        PROVEN(i >= 0 && i < n_a && j >= 0 && j < n_b);
        for (int k = 0; k < AXES; k++) {
            double end = a[k * n_a + i], back = a[(k + AXES) * n_a + i];
            double common = mind(end, b[k * n_b + j] + jitter_m) + mind(back, b[(k + AXES) * n_b + j] + jitter_m);
            share[k] = maxd(common, 0.0) / maxd(end + back, jitter_m);
        }
        coverage[pair] = mind(share[EAST] * share[NORTH], share[NORTH_EAST] * share[NORTH_WEST]);
    }
}

/* measured: displacements from k-DOPs a to b (8, n) with their covariances. `sight` (2, n) are unit vectors from the
 * sensor. `end_variance` (4, n) is the variance by ends that disagree; `before` (4, n) is what it was a frame ago. */
EXPORT void modt_measured(const double *a, const double *b, const double *sight, i64 n, double variance,
                          const double *before,
                          const ShapeTuning *tuning, double (*shift)[2], double (*covariance)[2][2],
                          double *end_variance)
{
    const double doubt_across = tuning->disagreement * tuning->disagreement;
    const double doubt_near = tuning->near_disagreement * tuning->near_disagreement;
    for (i64 i = 0; i < n; i++) {
        /* Along each axis: twice the mean displacement of its ends, and by how much the width grew. */
        double both[AXES], growth[AXES], widest = -INFINITY, longest = 1.0;
        for (int k = 0; k < AXES; k++) {
            double ahead = b[k * n + i] - a[k * n + i], behind = b[(k + AXES) * n + i] - a[(k + AXES) * n + i];
            double width = b[k * n + i] + b[(k + AXES) * n + i];
            both[k] = ahead - behind;
            growth[k] = ahead + behind;
            widest = maxd(widest, width);
            longest = maxd(longest, maxd(width, width - growth[k])); /* after and before */
        }
        double weight[AXES], weighted[AXES], seen_along[AXES];
        along_axes(sight[i], sight[n + i], seen_along);
        for (int k = 0; k < AXES; k++) {
            double relative_growth = growth[k] * (longest / tuning->agreement_m);
            double agreement = maxd(1 - relative_growth * relative_growth, 0.0);
            double disagreement = 1 - agreement * agreement;
            const int is_near = __builtin_fabs(seen_along[k]) > tuning->near_cosine;
            const double near_share = is_near ? seen_along[k] * seen_along[k] : 0;
            const double doubt = near_share * doubt_near + (1 - near_share) * doubt_across;
            const double to_end = is_near ? __builtin_copysign(1.0, seen_along[k]) * growth[k]
                                          : __builtin_copysign(growth[k], both[k]);
            double by_ends = maxd(doubt * disagreement * (growth[k] * growth[k]),
                                  tuning->end_variance_decay * before[k * n + i]);
            by_ends = mind(by_ends, doubt * (widest * widest));
            end_variance[k * n + i] = by_ends;
            weight[k] = 0.5 / (variance + by_ends);
            weighted[k] = weight[k] * ((both[k] - disagreement * to_end) / 2);
        }
        /* The inverse of the covariance is the sum over the axes of weight * axis * axis'. */
        double diagonal = (weight[NORTH_EAST] + weight[NORTH_WEST]) / 2;
        double inverse_xx = weight[EAST] + diagonal, inverse_yy = weight[NORTH] + diagonal;
        double inverse_xy = (weight[NORTH_EAST] - weight[NORTH_WEST]) / 2;
        double scale = 1.0 / (inverse_xx * inverse_yy - inverse_xy * inverse_xy);
        double xx = scale * inverse_yy, yy = scale * inverse_xx, xy = -scale * inverse_xy;
        double x = sum_x(weighted), y = sum_y(weighted);
        covariance[i][0][0] = xx;
        covariance[i][1][1] = yy;
        covariance[i][0][1] = covariance[i][1][0] = xy;
        shift[i][0] = xx * x + xy * y;
        shift[i][1] = xy * x + yy * y;
    }
}
