/* Extents and boxes of groups of points, and pairs of k-DOPs. A group i has the points from offsets[i] to
 * offsets[i + 1]; none is empty. */
#include "kernels.h"

typedef float f8 __attribute__((vector_size(32), aligned(4)));
typedef i32 i8 __attribute__((vector_size(32)));
typedef i64 l4 __attribute__((vector_size(32)));

/* Least and greatest coordinates of points, at least one, along four axes of which x, y and z are given. */
static ALWAYS_INLINE void ends_along(const float *x, const float *y, const float *z, i64 i, i64 end, const f4 axes[3],
                                     f4 *least, f4 *greatest)
{
    f4 low[2] = {spread(INFINITY), spread(INFINITY)}, high[2] = {-low[0], -low[0]};
    if ((end - i) & 1) { /* then two at a time, which do not wait for one another */
        low[0] = high[0] = axes[0] * spread(x[i]) + axes[1] * spread(y[i]) + axes[2] * spread(z[i]);
        i++;
    }
    for (; i < end; i += 2)
        for (int k = 0; k < 2; k++) {
            f4 along = axes[0] * spread(x[i + k]) + axes[1] * spread(y[i + k]) + axes[2] * spread(z[i + k]);
            low[k] = least4(along, low[k]);
            high[k] = most4(along, high[k]);
        }
    *least = least4(low[0], low[1]);
    *greatest = most4(high[0], high[1]);
}

/* kdop_ends: greatest coordinates of n groups of points along four axes, then against them, eight rows of n. */
EXPORT void modt_kdop_ends(const float *x, const float *y, const float *z, const i64 *offsets, i64 n,
                           const float *axes, float *ends)
{
    f4 along[3], low, high;
    __builtin_memcpy(along, axes, sizeof along);
    for (i64 g = 0; g < n; g++) {
        ends_along(x, y, z, offsets[g], offsets[g + 1], along, &low, &high);
        for (int k = 0; k < 4; k++) {
            ends[k * n + g] = high[k];
            ends[(k + 4) * n + g] = -low[k];
        }
    }
}

/* upright_boxes: boxes of n groups of points, at headings of which the cosine and the sine are given, or across them. */
EXPORT void modt_upright_boxes(const float *x, const float *y, const float *z, const i64 *offsets, i64 n,
                               const double *yaw, const double *cosine, const double *sine, double quarter_turn,
                               double (*box)[7])
{
    for (i64 g = 0; g < n; g++) {
        float c = (float)cosine[g], s = (float)sine[g];
        f4 axes[3] = {{c, -s, 0.0f, 0.0f}, {s, c, 0.0f, 0.0f}, {0.0f, 0.0f, 1.0f, 0.0f}}, low, high;
        double middle[3], side[3];
        ends_along(x, y, z, offsets[g], offsets[g + 1], axes, &low, &high);
        for (int k = 0; k < 3; k++) {
            middle[k] = ((double)low[k] + (double)high[k]) / 2;
            side[k] = (double)high[k] - (double)low[k];
        }
        int turn = side[0] < side[1];
        box[g][0] = middle[0] * cosine[g] - middle[1] * sine[g];
        box[g][1] = middle[0] * sine[g] + middle[1] * cosine[g];
        box[g][2] = middle[2];
        box[g][3] = side[turn];
        box[g][4] = side[!turn];
        box[g][5] = side[2];
        box[g][6] = turn ? yaw[g] - quarter_turn : yaw[g];
    }
}

/* overlapping_pairs: pairs of k-DOPs a (8, n) and b (8, k) that overlap along x and along y. Returns how many there are;
 * no more than `limit` are written. Rounding keeps the order of numbers, so that pairs which do not overlap in single
 * precision need no other look. Scratch: `least`, 64 numbers for each sixteen of b. */
EXPORT i64 modt_overlapping_pairs(const double *a, i64 n, const double *b, i64 k, f8 (*least)[4][2], i64 limit,
                                  i64 *one, i64 *other)
{
    const double *to[4] = {b + 4 * k, b, b + 6 * k, b + 2 * k}; /* what the ends of a, negated, have to reach */
    i64 groups = (k + 15) / 16, count = 0;
    for (i64 j = 0; j < 16 * groups; j++)
        for (int side = 0; side < 4; side++)
            least[j / 16][side][j / 8 % 2][j % 8] = j < k ? (float)-to[side][j] : __builtin_nanf(""); /* not reached */
    for (i64 i = 0; i < n; i++) {
        double end[4] = {a[i], a[4 * n + i], a[2 * n + i], a[6 * n + i]}; /* to the east, west, north and south */
        float east = (float)end[0], west = (float)end[1], north = (float)end[2], south = (float)end[3];
        for (i64 g = 0; g < groups; g++) {
            i8 near[2];
            for (int f = 0; f < 2; f++)
                near[f] = (east >= least[g][0][f]) & (west >= least[g][1][f]) & (north >= least[g][2][f]) &
                          (south >= least[g][3][f]);
            l4 any = (l4)(near[0] | near[1]);
            if (!(any[0] | any[1] | any[2] | any[3]))
                continue;
            for (i64 at = 0, j = 16 * g; at < 16; at++, j++)
                if (near[at / 8][at % 8] && end[0] >= -to[0][j] && end[1] >= -to[1][j] && end[2] >= -to[2][j] &&
                    end[3] >= -to[3][j]) {
                    if (count < limit) {
                        one[count] = i;
                        other[count] = j;
                    }
                    count++;
                }
        }
    }
    return count;
}

typedef struct {
    const double *kdop, *log_width, *bottom, *top, *log_count; /* 8, 4, 1, 1, 1 numbers of each, row by row */
    i64 n;
} Shapes;

typedef struct {
    double size, overlap, height, count;
} PairWeights;

static inline double apart(double a, double b) { return __builtin_fabs(a - b); }

/* pair_costs: coverage of n pairs (i, j) of shapes a and b, cost without the term of the determinant, and that
 * determinant over its least; `covariance` has the xx, then the xy, then the yy of a. */
EXPORT void modt_pair_costs(const Shapes *a, const Shapes *b, const double *covariance, double variance,
                            const i64 *rows, const i64 *columns, i64 n, const PairWeights *weights, double half_root,
                            double pad_m, double *spread, double *cost, double *coverage)
{
    for (i64 pair = 0; pair < n; pair++) {
        i64 i = rows[pair], j = columns[pair];
        PROVEN(i >= 0 && i < a->n && j >= 0 && j < b->n);
        double moved[4], side[4], other_side[4], common[4], size = 0.0, overlap[2], covered[2];
        for (int k = 0; k < 4; k++) {
            double one = a->kdop[k * a->n + i], one_back = a->kdop[(k + 4) * a->n + i];
            double other = b->kdop[k * b->n + j], other_back = b->kdop[(k + 4) * b->n + j];
            double ahead = other - one, behind = -(other_back - one_back);
            moved[k] = __builtin_fabs(ahead) < __builtin_fabs(behind) ? ahead : behind;
            common[k] = high(low(one, other) + low(one_back, other_back) + pad_m, 0.0);
            side[k] = one + one_back + pad_m;
            other_side[k] = other + other_back + pad_m;
            size += apart(b->log_width[k * b->n + j], a->log_width[k * a->n + i]);
        }
        for (int k = 0; k < 2; k++) { /* of the upright rectangles, and of those at 45 degrees */
            double area = side[k] * side[k + 2], other_area = other_side[k] * other_side[k + 2];
            double shared = common[k] * common[k + 2];
            overlap[k] = shared / (area + other_area - shared);
            covered[k] = shared / low(area, other_area);
        }
        double xx = covariance[i] + variance, xy = covariance[a->n + i], yy = covariance[2 * a->n + i] + variance;
        double dx = (moved[0] + half_root * (moved[1] - moved[3])) / 2;
        double dy = (moved[2] + half_root * (moved[1] + moved[3])) / 2;
        double shape = weights->size * (size / 4) + weights->overlap * (1 - low(overlap[0], overlap[1]));
        double height = apart(a->top[i], b->top[j]) + apart(a->bottom[i], b->bottom[j]);
        shape += weights->height * height / 2 + weights->count * apart(a->log_count[i], b->log_count[j]);
        double determinant = xx * yy - xy * xy;
        spread[pair] = determinant / (variance * variance);
        cost[pair] = (yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy) / determinant / 2 + shape;
        coverage[pair] = low(covered[0], covered[1]);
    }
}

/* coverage: part of each k-DOP a (8, n_a) that b (8, n_b) covers, of n pairs (i, j). */
EXPORT void modt_coverage(const double *a, i64 n_a, const double *b, i64 n_b, const i64 *rows, const i64 *columns, i64 n,
                          double pad_m, double *coverage)
{
    for (i64 pair = 0; pair < n; pair++) {
        double part[4];
        i64 i = rows[pair], j = columns[pair];
        PROVEN(i >= 0 && i < n_a && j >= 0 && j < n_b);
        for (int k = 0; k < 4; k++) {
            double one = a[k * n_a + i], back = a[(k + 4) * n_a + i];
            double common = low(one, b[k * n_b + j] + pad_m) + low(back, b[(k + 4) * n_b + j] + pad_m);
            part[k] = high(common, 0.0) / high(one + back, pad_m);
        }
        coverage[pair] = low(part[0] * part[2], part[1] * part[3]);
    }
}

/* measured: displacements between n k-DOPs a and b (8, n) with their covariances, and the variances by ends that
 * disagree, of which `before` were a frame ago; given the limit of agreement, the squared share and the decay. */
EXPORT void modt_measured(const double *a, const double *b, i64 n, double variance, const double *before,
                          const double limits[3], double half_root, double (*shift)[2], double (*covariance)[2][2],
                          double *end_variance)
{
    for (i64 m = 0; m < n; m++) {
        double both[4], apart[4], weight[4], widest = -INFINITY, longest = 1.0;
        for (int k = 0; k < 4; k++) {
            double ahead = b[k * n + m] - a[k * n + m], behind = b[(k + 4) * n + m] - a[(k + 4) * n + m];
            double width = b[k * n + m] + b[(k + 4) * n + m];
            both[k] = ahead - behind, apart[k] = ahead + behind;
            widest = high(widest, width), longest = high(longest, high(width, width - apart[k]));
        }
        for (int k = 0; k < 4; k++) {
            double off = apart[k] * (longest / limits[0]), alike = high(1 - off * off, 0.0), unlike = 1 - alike * alike;
            double by_ends = high(limits[1] * unlike * (apart[k] * apart[k]), limits[2] * before[k * n + m]);
            end_variance[k * n + m] = by_ends = low(by_ends, limits[1] * (widest * widest));
            weight[k] = 0.5 / (variance + by_ends);
            both[k] = weight[k] * ((both[k] - unlike * __builtin_copysign(apart[k], both[k])) / 2);
        }
        double xx = weight[0] + (weight[1] + weight[3]) / 2, yy = weight[2] + (weight[1] + weight[3]) / 2;
        double xy = (weight[1] - weight[3]) / 2, scale = 1.0 / (xx * yy - xy * xy);
        double x = both[0] + half_root * (both[1] - both[3]), y = both[2] + half_root * (both[1] + both[3]);
        covariance[m][0][0] = scale * yy, covariance[m][1][1] = scale * xx;
        covariance[m][0][1] = covariance[m][1][0] = -scale * xy;
        shift[m][0] = covariance[m][0][0] * x + covariance[m][0][1] * y;
        shift[m][1] = covariance[m][0][1] * x + covariance[m][1][1] * y;
    }
}

/* certain_pairs: of n pairs, 1 for those kept for certain, 2 for contested ones, else 0. The rows and the columns of
 * contested pairs are numbered in two rows of `best`, of `most` each like the scratch `next`, and counted in `sizes`, which
 * held the greatest index + 1. */
EXPORT void modt_certain_pairs(const i64 *rows, const i64 *columns, const double *cost, i64 n, double limit,
                               i64 sizes[2], i64 *best, double *next, i64 most, uint8_t *state)
{
    const i64 *index[2] = {rows, columns};
    for (int side = 0; side < 2; side++) {
        for (i64 k = 0; k < sizes[side]; k++) {
            best[side * most + k] = NONE;
            next[side * most + k] = limit;
        }
        for (i64 pair = 0; pair < n; pair++) {
            PROVEN(index[side][pair] >= 0 && index[side][pair] < sizes[side]);
            i64 *own = &best[side * most + index[side][pair]];
            double *second = &next[side * most + index[side][pair]];
            if (*own == NONE || cost[pair] <= cost[*own]) {
                *second = *own == NONE ? limit : cost[*own];
                *own = pair;
            } else
                *second = low(cost[pair], *second);
        }
    }
    for (i64 pair = 0; pair < n; pair++)
        state[pair] = cost[pair] + limit < next[rows[pair]] + next[most + columns[pair]];
    for (i64 pair = 0; pair < n; pair++)
        if (state[best[rows[pair]]] != 1 && state[best[most + columns[pair]]] != 1)
            state[pair] = 2;
    for (int side = 0; side < 2; side++) {
        i64 number = 0, *numbers = best + side * most;
        for (i64 k = 0; k < sizes[side]; k++)
            numbers[k] = NONE;
        for (i64 pair = 0; pair < n; pair++)
            if (state[pair] == 2)
                numbers[index[side][pair]] = 0;
        for (i64 k = 0; k < sizes[side]; k++)
            if (numbers[k] != NONE)
                numbers[k] = number++;
        sizes[side] = number;
    }
}
