/* Extents of groups of points along axes, and pairs of extents that reach one another. */
#include "kernels.h"

typedef float f4 __attribute__((vector_size(16)));
typedef i32 i4 __attribute__((vector_size(16)));
typedef double d4 __attribute__((vector_size(32), aligned(8)));
typedef i64 l4 __attribute__((vector_size(32)));

static inline f4 least4(f4 a, f4 b) { i4 less = a < b; return (f4)(((i4)a & less) | ((i4)b & ~less)); }
static inline f4 most4(f4 a, f4 b) { i4 more = a > b; return (f4)(((i4)a & more) | ((i4)b & ~more)); }
static inline f4 spread(float a) { return (f4){a, a, a, a}; }

/* kdop_ends and bounds_along: greatest and least coordinates of groups of points along four axes. A group i has the
 * points from offsets[i] to offsets[i + 1]; none is empty. `axes` has their x, then their y, then their z; those of
 * the next group are `stride` numbers on. */
EXPORT void modt_ends_along(const float *x, const float *y, const float *z, const i64 *offsets, i64 n,
                            const float *axes, i64 stride, float *ahead, float *behind)
{
    for (i64 g = 0; g < n; g++, axes += stride) {
        f4 u, v, w, low[2] = {spread(INFINITY), spread(INFINITY)}, high[2] = {-low[0], -low[0]};
        __builtin_memcpy(&u, axes, sizeof u);
        __builtin_memcpy(&v, axes + 4, sizeof v);
        __builtin_memcpy(&w, axes + 8, sizeof w);
        i64 i = offsets[g], end = offsets[g + 1];
        if ((end - i) & 1) { /* then two at a time, which do not wait for one another */
            low[0] = high[0] = u * spread(x[i]) + v * spread(y[i]) + w * spread(z[i]);
            i++;
        }
        for (; i < end; i += 2)
            for (int k = 0; k < 2; k++) {
                f4 along = u * spread(x[i + k]) + v * spread(y[i + k]) + w * spread(z[i + k]);
                low[k] = least4(along, low[k]);
                high[k] = most4(along, high[k]);
            }
        low[0] = least4(low[0], low[1]);
        high[0] = most4(high[0], high[1]);
        __builtin_memcpy(behind + 4 * g, &low[0], sizeof low[0]);
        __builtin_memcpy(ahead + 4 * g, &high[0], sizeof high[0]);
    }
}

/* overlapping_pairs: pairs of k-DOPs a (8, n) and b (8, k) that overlap along x and along y. Returns how many there are;
 * no more than `limit` are written. Scratch: `least`, 64 numbers for each sixteen of b. */
EXPORT i64 modt_overlapping_pairs(const double *a, i64 n, const double *b, i64 k, d4 (*least)[4][4], i64 limit,
                                  i64 *one, i64 *other)
{
    i64 groups = (k + 15) / 16, count = 0;
    for (i64 j = 0; j < 16 * groups; j++)
        for (int side = 0; side < 4; side++) /* what the ends to the east, west, north and south of a have to reach */
            least[j / 16][side][j / 4 % 4][j % 4] = j < k ? -b[(side / 2 * 2 + (side % 2 ? 0 : 4)) * k + j] : INFINITY;
    for (i64 i = 0; i < n; i++) {
        double east = a[i], north = a[2 * n + i], west = a[4 * n + i], south = a[6 * n + i];
        for (i64 g = 0; g < groups; g++) {
            l4 near[4], any;
            for (int f = 0; f < 4; f++)
                near[f] = (east >= least[g][0][f]) & (west >= least[g][1][f]) & (north >= least[g][2][f]) &
                          (south >= least[g][3][f]);
            any = near[0] | near[1] | near[2] | near[3];
            if (!(any[0] | any[1] | any[2] | any[3]))
                continue;
            for (int at = 0; at < 16; at++)
                if (near[at / 4][at % 4]) {
                    if (count < limit) {
                        one[count] = i;
                        other[count] = 16 * g + at;
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

static inline double low(double a, double b) { return a < b ? a : b; }
static inline double high(double a, double b) { return a > b ? a : b; }
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

/* certain_pairs: of n pairs, 1 for those kept for certain, 2 for contested ones, else 0. Scratch: `best` of the
 * greatest index + 1, `next` likewise, for rows, and for columns. */
EXPORT void modt_certain_pairs(const i64 *index[2], const double *cost, i64 n, double limit, const i64 sizes[2],
                               i64 *best[2], double *next[2], uint8_t *state)
{
    for (int side = 0; side < 2; side++) {
        for (i64 k = 0; k < sizes[side]; k++) {
            best[side][k] = NONE;
            next[side][k] = limit;
        }
        for (i64 pair = 0; pair < n; pair++) {
            PROVEN(index[side][pair] >= 0 && index[side][pair] < sizes[side]);
            i64 *own = &best[side][index[side][pair]];
            double *second = &next[side][index[side][pair]];
            if (*own == NONE || cost[pair] <= cost[*own]) {
                *second = *own == NONE ? limit : cost[*own];
                *own = pair;
            } else
                *second = low(cost[pair], *second);
        }
    }
    for (i64 pair = 0; pair < n; pair++)
        state[pair] = cost[pair] + limit < next[0][index[0][pair]] + next[1][index[1][pair]];
    for (i64 pair = 0; pair < n; pair++)
        if (state[best[0][index[0][pair]]] != 1 && state[best[1][index[1][pair]]] != 1)
            state[pair] = 2;
}
