/* Points above the ground: GroundEstimator, with the columns and cells that it starts from. */
#include "kernels.h"

typedef struct {
    i32 rings, sectors, sector_bits, flank_sectors, bonnet_ring;
    float far_m, ring_scale, sector_scale;
    float min_sqrt_range, max_slope, ramp_slope, near_m, slope_gain, noise_m, max_gap_m, flank_m;
    float upper_m, bin_m;
} Ground;

/* Scratch of the caller: rings * sectors each and one more, then one a point. */
typedef struct {
    float *lowest, *surface, *near, (*ends)[2];
    uint8_t *kind;
    float *z, *sqrt_range;
    i32 *cell;
} Scratch;

enum { BLOCK = 512, GROUP = 8 }; /* points in the first-level cache, points kept or left out together */

/* x, y and z of n points. */
static ALWAYS_INLINE void take_columns(const u4 *points, i64 n, float *restrict x, float *restrict y, float *restrict z)
{
    i64 i = 0;
    for (; i + 4 <= n; i += 4) {
        const u4 *own = points + i;
        __builtin_prefetch(own + BLOCK); /* the processor itself looks ahead within a page only */
        u4 xy[2] = {MIXED(own[0], own[1], 0, 4, 1, 5), MIXED(own[2], own[3], 0, 4, 1, 5)};
        *(u4 *)(x + i) = MIXED(xy[0], xy[1], 0, 1, 4, 5);
        *(u4 *)(y + i) = MIXED(xy[0], xy[1], 2, 3, 6, 7);
        *(u4 *)(z + i) = MIXED(MIXED(own[0], own[1], 2, 6, 2, 6), MIXED(own[2], own[3], 2, 6, 2, 6), 0, 1, 4, 5);
    }
    for (; i < n; i++)
        x[i] = points[i][0], y[i] = points[i][1], z[i] = points[i][2];
}

/* PointColumns.from_array and PolarGrid.cell, of up to BLOCK points; those that are not finite, or as far as far_m,
 * are taken to the sensor. */
static void place_points(const Ground *g, const u4 *points, i64 n, float *restrict z, float *restrict sqrt_range,
                         i32 *restrict cell)
{
    float x[BLOCK], y[BLOCK];
    float last = (float)(g->rings - 1);
    i32 bits = g->sector_bits, mask = (1 << bits) - 1;
    take_columns(points, n, x, y, z);
    for (i64 i = 0; i < n; i++) {
        float far = g->far_m;
        int near = (magnitude(x[i]) < far) & (magnitude(y[i]) < far) & (magnitude(z[i]) < far); /* not for NaN */
        float here_x = near ? x[i] : 0.0f, here_y = near ? y[i] : 0.0f;
        z[i] = near ? z[i] : 0.0f;
        sqrt_range[i] = __builtin_sqrtf(__builtin_sqrtf(here_x * here_x + here_y * here_y));
        i32 ring = (i32)least(sqrt_range[i] * g->ring_scale, last);
        float turn = here_y / most(magnitude(here_x) + magnitude(here_y), 1e-6f);
        turn = (here_x < 0.0f ? 2.0f - turn : turn) + 1.0f;
        cell[i] = (ring << bits) + ((i32)(turn * g->sector_scale) & mask);
    }
}

/* GroundEstimator._lowest, of up to BLOCK points, and the highest of all points, negated: side by side in memory. Then
 * the cell of points out of bounds of range is `outside`. */
static void find_ends(const Ground *g, float height_m, const float bounds[4], i64 n, const float *z,
                      const float *sqrt_range, i32 *cell, float (*ends)[2])
{
    enum { APART = BLOCK / 8 };
    float candidate[BLOCK][2];
    i32 outside = g->rings * g->sectors;
    for (i64 i = 0; i < n; i++) {
        float reach = sqrt_range[i] * sqrt_range[i] * g->max_slope + g->noise_m;
        int plausible = (magnitude(z[i] + height_m) < reach) & (sqrt_range[i] > g->min_sqrt_range);
        candidate[i][0] = plausible ? z[i] : INFINITY;
        candidate[i][1] = -z[i];
    }
    for (i64 k = 0; k < APART; k++) /* neighbours share cells: those far apart do not wait for one another */
        for (i64 i = k; i < n; i += APART) {
            PROVEN(cell[i] >= 0 && cell[i] < outside);
            float *own = ends[cell[i]];
            own[0] = least(candidate[i][0], own[0]);
            own[1] = least(candidate[i][1], own[1]);
        }
    for (i64 i = 0; i < n; i++)
        cell[i] = (sqrt_range[i] > bounds[2]) & (sqrt_range[i] < bounds[3]) ? cell[i] : outside;
}

enum { GROUND = 1, STEEP = 2, RAMP = 4 }; /* of a cell: is ground, its ray rises or falls, so does one beside it */

/* A ring of GroundEstimator.trace, with the cells of the ring and the last ground cell of each ray, whose height and range
 * are left in `surface` and `near`. Something stands in a cell if its highest return lies flat_m above the lowest. */
static void trace_ring(const Ground *g, float range_m, float flat_m, float (*restrict ends)[2], float *restrict lowest,
                       uint8_t *restrict kind, float *restrict height, float *restrict at, float *restrict slope,
                       const float *restrict bend_m, float *restrict surface, float *restrict near)
{
    const Ground c = *g;
    for (i32 k = 0; k < c.sectors; k++) {
        lowest[k] = ends[k][0];
        float gap = range_m - at[k], reach = least(gap, c.max_gap_m);
        float rise = lowest[k] - height[k], off = rise - slope[k] * reach;
        float flat = -ends[k][1] > lowest[k] + flat_m ? 0.0f : 1.0f;
        float bound = least(gap, bend_m[k]) * c.max_slope * flat + c.noise_m;
        int found = (off < bound) & (off > -(gap * c.max_slope + c.noise_m));
        float newest = slope[k] + c.slope_gain * (rise / gap - slope[k]);
        newest = least(most(newest, -c.max_slope), c.max_slope);
        surface[k] = height[k] = found ? lowest[k] : height[k];
        near[k] = at[k] = found ? range_m : at[k];
        slope[k] = found ? newest : slope[k];
        kind[k] = (uint8_t)(found | (magnitude(slope[k]) > c.ramp_slope) << 1);
    }
}

/* A row of `size` bytes with `step` of them from its other end on either side, so that no index wraps. */
static void close_round(const void *row, i64 step, i64 size, void *round)
{
    __builtin_memcpy(round, (const char *)row + size - step, step);
    __builtin_memcpy((char *)round + step, row, size);
    __builtin_memcpy((char *)round + step + size, row, step);
}

/* GroundEstimator.trace; `ray` holds height, range and slope of the last ground cell of each ray, and how far
 * from it the ground may rise by max_slope */
static void trace(const Ground *g, float height_m, const float *range_m, const float *flat_m, Scratch *s, float *ray)
{
    i32 sectors = g->sectors, flank = g->flank_sectors;
    float *height = ray, *at = ray + sectors, *slope = ray + 2 * sectors, *bend_m = ray + 3 * sectors;
    float near_m = g->near_m, max_gap_m = g->max_gap_m;
    for (i32 k = 0; k < sectors; k++) {
        height[k] = -height_m;
        at[k] = slope[k] = 0.0f;
        bend_m[k] = near_m;
    }
    for (i32 ring = 0; ring < g->rings; ring++) {
        i32 row = ring * sectors;
        uint8_t *kind = s->kind + row, *round = (uint8_t *)(s->ends + row); /* the ends are needed no more */
        trace_ring(g, range_m[ring], flat_m[ring], s->ends + row, s->lowest + row, kind, height, at, slope, bend_m,
                   s->surface + row, s->near + row);
        close_round(kind, flank, sectors, round);
        for (i32 k = 0; k < sectors; k++) {
            i32 steep = (round[k] | round[k + flank] | round[k + 2 * flank]) & STEEP;
            kind[k] = (uint8_t)(kind[k] | steep << 1);
            bend_m[k] = steep ? max_gap_m : near_m;
        }
    }
}

/* A ring of GroundEstimator._interpolate, given the ground cell before each cell, whose height is in `surface`, the one
 * after the ring, at NONE without any, and the slope on which a ray goes on. */
static void blend(const Ground *g, const float *range_of, i32 ring, const uint8_t *restrict kind, float *restrict value,
                  float *restrict at, const float *restrict slope, const float *restrict lowest,
                  float *restrict surface, const float *restrict near)
{
    const Ground c = *g;
    float range_m = range_of[ring], first_m = range_of[0];
    for (i32 k = 0; k < c.sectors; k++) {
        float from = surface[k], from_at = most(near[k], first_m), since = range_m - from_at;
        float after = value[k], after_at = at[k];
        value[k] = after = kind[k] & GROUND ? from : after;
        at[k] = after_at = kind[k] & GROUND ? range_m : after_at;
        float between = from + (after - from) * (since / most(after_at - from_at, 1e-3f));
        float ramp = from + slope[k] * least(since, c.max_gap_m);
        surface[k] = after_at < 0.0f ? least(ramp, most(lowest[k], from)) : between; /* a ramp rises above no return */
    }
}

/* GroundEstimator._interpolate: linear from the ground cell before each cell to the one after it, or on with the
 * slope of its ramp; `ray` comes from trace */
static void interpolate(const Ground *g, const float *range_m, Scratch *s, float *ray)
{
    i32 sectors = g->sectors;
    float *value = ray, *at = ray + sectors, *slope = ray + 2 * sectors;
    for (i32 k = 0; k < sectors; k++) {
        s->kind[k] |= GROUND; /* the foot of the sensor */
        at[k] = NONE;
        slope[k] = magnitude(slope[k]) > g->ramp_slope ? slope[k] : 0.0f;
    }
    for (i32 ring = g->rings - 1, row = ring * sectors; ring >= 0; ring--, row -= sectors)
        blend(g, range_m, ring, s->kind + row, value, at, slope, s->lowest + row, s->surface + row, s->near + row);
}

/* _median_across, in a row of cells; `round` is scratch. */
static void median_across(i32 sectors, i32 step, const float *row, float *restrict round, float *restrict median)
{
    close_round(row, step * sizeof *row, sectors * sizeof *row, round);
    for (i32 k = 0; k < sectors; k++) {
        float left = round[k], own = round[k + step], right = round[k + 2 * step];
        median[k] = most(least(left, own), least(most(left, own), right));
    }
}

/* Kernels.above_ground, of up to BLOCK points: the rows of those between bounds of height, their x, y, z, square root of
 * range, and height, written from `count` on, where there is room for one more; returns how many there are then. */
static i64 keep_points(const Scratch *s, const u4 *points, i64 start, i64 n, const float bounds[4], i64 count,
                       i64 *rows, float *const kept[5])
{
    const uint64_t all = 0x0101010101010101;
    float height[BLOCK], low = bounds[0], high = bounds[1];
    uint8_t kept_here[BLOCK + GROUP] = {0};
    for (i64 i = 0; i < n; i++)
        height[i] = s->z[start + i] - s->surface[s->cell[start + i]];
    for (i64 i = 0; i < n; i++)
        kept_here[i] = (height[i] > low) & (height[i] < high);
    for (i64 first = 0; first < n; first += GROUP) {
        i64 row = start + first;
        uint64_t group;
        __builtin_memcpy(&group, kept_here + first, GROUP);
        if (group == all) {
            for (i64 i = 0; i < GROUP; i++)
                rows[count + i] = row + i;
            take_columns(points + row, GROUP, kept[0] + count, kept[1] + count, kept[2] + count);
            __builtin_memcpy(kept[3] + count, s->sqrt_range + row, GROUP * sizeof(float));
            __builtin_memcpy(kept[4] + count, height + first, GROUP * sizeof(float));
            count += GROUP;
        } else if (group) /* most often there is none: ground */
            for (i64 i = first; i < first + GROUP && i < n; i++, row++) {
                rows[count] = row; /* overwritten by the next, unless it stays */
                for (int v = 0; v < 3; v++)
                    kept[v][count] = points[row][v];
                kept[3][count] = s->sqrt_range[row];
                kept[4][count] = height[i];
                count += kept_here[i];
            }
    }
    return count;
}

/* Kernels.above_ground: of n points, those within bounds of height and of square root of range; returns how many. Their
 * rows are written, and x, y, z, square root of range, and height, and those from upper_m up are counted in bins of
 * height. `range_m` and `flat_m` are by ring; a ray has 4 * sectors floats. */
EXPORT i64 modt_above_ground(const Ground *g, const float *range_m, const float *flat_m, float height_m,
                             const u4 *points, i64 n, Scratch *s, float *ray, const float bounds[4], i64 *rows,
                             float *kept[5], i64 *bins)
{
    i64 cells = g->rings * g->sectors, count = 0;
    for (i64 k = 0; k < cells; k++)
        s->ends[k][0] = s->ends[k][1] = INFINITY;
    for (i64 i = 0; i < n; i += BLOCK) {
        i64 m = n - i < BLOCK ? n - i : BLOCK;
        place_points(g, points + i, m, s->z + i, s->sqrt_range + i, s->cell + i);
        find_ends(g, height_m, bounds, m, s->z + i, s->sqrt_range + i, s->cell + i, s->ends);
    }
    for (i64 k = (i64)g->bonnet_ring * g->sectors; k < cells - g->sectors; k++) /* as _stands */
        s->ends[k][1] = least(s->ends[k][1], s->ends[k + g->sectors][1]);
    trace(g, height_m, range_m, flat_m, s, ray);
    interpolate(g, range_m, s, ray);
    for (i64 first = 0; first < cells; first += g->sectors) {
        float *row = s->surface + first, *beside = ray + g->sectors, *round = beside + g->sectors;
        median_across(g->sectors, 1, row, round, ray);
        median_across(g->sectors, g->flank_sectors, ray, round, beside);
        for (i32 k = 0; k < g->sectors; k++) {
            int hidden = s->kind[first + k] & RAMP ? ray[k] < beside[k] : ray[k] - beside[k] > g->flank_m;
            row[k] = hidden ? beside[k] : ray[k];
        }
    }
    s->surface[cells] = INFINITY; /* above all points out of bounds of range */
    for (i64 i = 0; i < n; i += BLOCK)
        count = keep_points(s, points, i, n - i < BLOCK ? n - i : BLOCK, bounds, count, rows, kept);
    for (i64 k = 0; k < count; k++)
        if (kept[4][k] > g->upper_m)
            bins[(i32)((kept[4][k] - g->upper_m) / g->bin_m)]++;
    return count;
}
