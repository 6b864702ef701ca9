/* Points above the ground: GroundEstimator, with the columns and cells that it starts from. */
#include "kernels.h"

typedef struct {
    i32 rings, sectors, sector_bits, flank_sectors;
    float far_m, ring_scale, sector_scale;
    float min_sqrt_range, max_slope, ramp_slope, near_m, slope_gain, noise_m, max_gap_m, flank_m;
    float upper_m, bin_m;
} Ground;

/* Scratch of the caller: rings * sectors each, then one a point. */
typedef struct {
    float *lowest, *surface, *other;
    uint8_t *stands, *kind;
    float *z, *sqrt_range;
    i32 *cell;
} Scratch;

enum { BLOCK = 512, GROUP = 8, LINE = 16 }; /* points in the first-level cache, points left out together, floats of a line */

/* PointColumns.from_array and PolarGrid.cell, of up to BLOCK points; those that are not finite, or as far as far_m,
 * are taken to the sensor. */
static ALWAYS_INLINE void place_points(const Ground *g, const float *points, i64 n, i64 width, float *z,
                                       float *sqrt_range, i32 *cell)
{
    float x[BLOCK], y[BLOCK];
    float last = (float)(g->rings - 1);
    i32 bits = g->sector_bits, mask = (1 << bits) - 1;
    for (i64 i = 0; i < n; i++) {
        x[i] = points[i * width];
        y[i] = points[i * width + 1];
        z[i] = points[i * width + 2];
    }
    for (i64 i = 0; i < n * width; i += LINE) /* the next block; the processor itself looks ahead within a page only */
        __builtin_prefetch(points + BLOCK * width + i);
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

/* GroundEstimator._lowest, of up to BLOCK points, and the highest of all points */
static void find_bounds(const Ground *g, float height_m, const float *z, const float *sqrt_range, const i32 *cell,
                        i64 n, float *lowest, float *highest)
{
    float candidate[BLOCK];
    for (i64 i = 0; i < n; i++) {
        float reach = sqrt_range[i] * sqrt_range[i] * g->max_slope + g->noise_m;
        int plausible = (magnitude(z[i] + height_m) < reach) & (sqrt_range[i] > g->min_sqrt_range);
        candidate[i] = plausible ? z[i] : INFINITY;
    }
    for (i64 k = 0; k < BLOCK / 4; k++) /* neighbours share cells: those far apart do not wait for one another */
        for (i64 part = 0, i = k; part < 4 && i < n; part++, i += BLOCK / 4) {
            PROVEN(cell[i] >= 0 && cell[i] < g->rings * g->sectors);
            lowest[cell[i]] = least(candidate[i], lowest[cell[i]]);
            highest[cell[i]] = most(z[i], highest[cell[i]]);
        }
}

/* GroundEstimator._stands: a return lies far above the lowest if the highest does; flat_m by ring */
static void find_stands(const Ground *g, const float *flat_m, const float *highest, Scratch *s)
{
    for (i32 ring = 0; ring < g->rings; ring++)
        for (i32 k = ring * g->sectors; k < (ring + 1) * g->sectors; k++)
            s->stands[k] = highest[k] > s->lowest[k] + flat_m[ring];
}

enum { GROUND = 1, STEEP = 2, RAMP = 4 }; /* of a cell: is ground, its ray rises or falls, so does one beside it */

/* A ring of GroundEstimator.trace, with the cells of the ring and the last ground cell of each ray. */
static void trace_ring(const Ground *g, float range_m, const float *restrict lowest, const uint8_t *restrict stands,
                       uint8_t *restrict kind, float *restrict height, float *restrict at, float *restrict slope,
                       const float *restrict bend_m)
{
    const Ground c = *g;
    for (i32 k = 0; k < c.sectors; k++) {
        float gap = range_m - at[k], reach = least(gap, c.max_gap_m);
        float rise = lowest[k] - height[k], off = rise - slope[k] * reach;
        float flat = stands[k] ? 0.0f : 1.0f;
        float bound = least(gap, bend_m[k]) * c.max_slope * flat + c.noise_m;
        int found = (off < bound) & (off > -(gap * c.max_slope + c.noise_m));
        float newest = slope[k] + c.slope_gain * (rise / gap - slope[k]);
        newest = least(most(newest, -c.max_slope), c.max_slope);
        height[k] = found ? lowest[k] : height[k];
        at[k] = found ? range_m : at[k];
        slope[k] = found ? newest : slope[k];
        kind[k] = (uint8_t)(found | (magnitude(slope[k]) > c.ramp_slope) << 1);
    }
}

/* GroundEstimator.trace; `ray` holds height, range and slope of the last ground cell of each ray, and how far
 * from it the ground may rise by max_slope */
static void trace(const Ground *g, float height_m, const float *range_m, Scratch *s, float *ray)
{
    i32 sectors = g->sectors;
    float *height = ray, *at = ray + sectors, *slope = ray + 2 * sectors, *bend_m = ray + 3 * sectors;
    i32 mask = sectors - 1;
    for (i32 k = 0; k < sectors; k++) {
        height[k] = -height_m;
        at[k] = slope[k] = 0.0f;
        bend_m[k] = g->near_m;
    }
    for (i32 ring = 0; ring < g->rings; ring++) {
        i32 row = ring * sectors;
        uint8_t *kind = s->kind + row;
        trace_ring(g, range_m[ring], s->lowest + row, s->stands + row, kind, height, at, slope, bend_m);
        for (i32 k = 0; k < sectors; k++) {
            i32 steep = kind[k] | kind[(k - g->flank_sectors) & mask] | kind[(k + g->flank_sectors) & mask];
            kind[k] |= (uint8_t)((steep & STEEP) << 1);
            bend_m[k] = steep & STEEP ? g->max_gap_m : g->near_m;
        }
    }
}

/* Takes the ground cells of a ring, all of its cells if `all`, as the last ground cells of their rays. */
static void advance(i32 sectors, const uint8_t *restrict kind, int all, const float *restrict height, float range_m,
                    float *restrict value, float *restrict at)
{
    for (i32 k = 0; k < sectors; k++) {
        int here = (kind[k] & GROUND) | all;
        float own = height[k], last = value[k], last_at = at[k];
        value[k] = here ? own : last;
        at[k] = here ? range_m : last_at;
    }
}

/* Surface of a ring, given the ground cell after each cell and the one before it, whose height is in `surface`. */
static void blend(i32 sectors, float range_m, const float *restrict value, const float *restrict at,
                  float *restrict surface, const float *restrict near)
{
    for (i32 k = 0; k < sectors; k++) {
        float from = surface[k], high = at[k] < 0.0f ? from : value[k], far = at[k] < 0.0f ? near[k] : at[k];
        surface[k] = from + (high - from) * ((range_m - near[k]) / most(far - near[k], 1e-3f));
    }
}

/* GroundEstimator._interpolate: linear from the ground cell before each cell to the one after it */
static void interpolate(const Ground *g, float height_m, const float *range_m, Scratch *s, float *ray)
{
    i32 sectors = g->sectors;
    float *value = ray, *at = ray + sectors, *low = s->surface, *near = s->other;
    for (i32 k = 0; k < sectors; k++) {
        value[k] = -height_m;
        at[k] = range_m[0];
    }
    for (i32 ring = 0, row = 0; ring < g->rings; ring++, row += sectors) {
        advance(sectors, s->kind + row, 0, s->lowest + row, range_m[ring], value, at);
        __builtin_memcpy(low + row, value, sectors * sizeof *low);
        __builtin_memcpy(near + row, at, sectors * sizeof *near);
    }
    for (i32 k = 0; k < sectors; k++)
        at[k] = -1.0f; /* nothing beyond */
    for (i32 ring = g->rings - 1, row = ring * sectors; ring >= 0; ring--, row -= sectors) {
        advance(sectors, s->kind + row, ring == 0, low + row, range_m[ring], value, at);
        blend(sectors, range_m[ring], value, at, low + row, near + row);
    }
}

/* _median_across, in a row of cells */
static void median_across(i32 sectors, i32 step, const float *row, float *median)
{
    i32 mask = sectors - 1;
    for (i32 k = 0; k < sectors; k++) {
        float left = row[(k - step) & mask], right = row[(k + step) & mask];
        median[k] = most(least(left, row[k]), least(most(left, row[k]), right));
    }
}

/* Kernels.above_ground: of n points in rows of `width`, those within bounds of height and of square root of
 * range; returns how many. Their rows are written, and x, y, z, square root of range, and height, and those from upper_m
 * up are counted in bins of height. `range_m` and `flat_m` are by ring; a ray has 4 * sectors floats. */
EXPORT i64 modt_above_ground(const Ground *g, const float *range_m, const float *flat_m, float height_m,
                             const float *points, i64 n, i64 width, Scratch *s, float *ray, const float bounds[4],
                             i64 *rows, float *kept[5], i64 *bins)
{
    float *highest = s->other;
    for (i32 i = 0; i < g->rings * g->sectors; i++) {
        s->lowest[i] = INFINITY;
        highest[i] = -INFINITY;
    }
    for (i64 i = 0; i < n; i += BLOCK) {
        i64 m = n - i < BLOCK ? n - i : BLOCK;
        float *z = s->z + i, *sqrt_range = s->sqrt_range + i;
        if (width == 4) /* inlined for this width, and vectorised */
            place_points(g, points + i * 4, m, 4, z, sqrt_range, s->cell + i);
        else
            place_points(g, points + i * width, m, width, z, sqrt_range, s->cell + i);
        find_bounds(g, height_m, z, sqrt_range, s->cell + i, m, s->lowest, highest);
    }
    find_stands(g, flat_m, highest, s);
    trace(g, height_m, range_m, s, ray);
    interpolate(g, height_m, range_m, s, ray);
    for (i32 ring = 0; ring < g->rings; ring++) {
        float *row = s->surface + ring * g->sectors;
        const uint8_t *kind = s->kind + ring * g->sectors;
        median_across(g->sectors, 1, row, ray);
        median_across(g->sectors, g->flank_sectors, ray, ray + g->sectors);
        for (i32 k = 0; k < g->sectors; k++) {
            float beside = ray[g->sectors + k];
            row[k] = (kind[k] & RAMP ? ray[k] < beside : ray[k] - beside > g->flank_m) ? beside : ray[k];
        }
    }
    float low = bounds[0], high = bounds[1], near = bounds[2], far = bounds[3];
    i64 count = 0;
    for (i64 start = 0; start < n; start += BLOCK) {
        float height[BLOCK + GROUP];
        uint8_t kept_here[BLOCK + GROUP] = {0};
        i64 m = n - start < BLOCK ? n - start : BLOCK;
        for (i64 i = 0; i < m; i++)
            height[i] = s->z[start + i] - s->surface[s->cell[start + i]];
        for (i64 i = 0; i < m; i++) {
            float sqrt_range = s->sqrt_range[start + i];
            kept_here[i] = (height[i] > low) & (height[i] < high) & (sqrt_range > near) & (sqrt_range < far);
        }
        for (i64 first = 0; first < m; first += GROUP) {
            uint64_t any;
            __builtin_memcpy(&any, kept_here + first, GROUP);
            if (!any) /* most often: ground */
                continue;
            for (i64 i = first; i < first + GROUP; i++) {
                rows[count] = start + i; /* overwritten by the next, unless it stays */
                kept[4][count] = height[i];
                count += kept_here[i];
            }
        }
    }
    for (i64 k = 0; k < count; k++) {
        const float *point = points + rows[k] * width;
        kept[0][k] = point[0];
        kept[1][k] = point[1];
        kept[2][k] = point[2];
        kept[3][k] = s->sqrt_range[rows[k]];
        if (kept[4][k] > g->upper_m)
            bins[(i32)((kept[4][k] - g->upper_m) / g->bin_m)]++;
    }
    return count;
}
