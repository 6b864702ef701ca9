/* Points above the ground: GroundEstimator and Kernels.above_ground in one go.
 *
 * Order of the passes of a sweep of n points:
 *   1. place_points    columns of the points, and the cell of each on the polar grid
 *   2. find_ends       lowest return of each cell that can be ground, and highest return of each cell
 *   3. trace           which cells are ground, ring by ring from the sensor outwards, all rays at once
 *   4. interpolate     surface of the ground, ring by ring inwards
 *   5. smooth          medians across the rays: the ground under a vehicle is that beside it
 *   6. keep_points     points within bounds, with their heights, and low points that may belong to something
 *   7. append_low      those after the others
 * Before 3, measure_roughness tells how far above the ground a return is clear of it. Then reach_across raises the
 * highest returns below gaps of dead beams, and cells far away take the highest return of the next ring too (_tops).
 * Passes 1, 2 and 6 go by blocks of points that stay in the first-level cache. A value a cell stands at
 * ring * sectors + sector; the cell after the last stands for the points out of bounds of range.
 */
#include "kernels.h"

/* GroundEstimator, GroundTuning, PolarGrid and Bounds: values by the names that they have there. */
typedef struct {
    const float *edge_m SHAPE(edges);           /* range of the edges of the rings, one more than there are rings */
    const float *flat_m, *depth_m SHAPE(rings); /* height range above which something stands in a cell; way looked at */
    i32 rings, sectors, flank_sectors, bonnet_ring; /* sectors are a power of two */
    float far_m;                                    /* points as far away have no position */
    float rings_per_unit, ring_step;                /* of the square root of range */
    float max_slope, hill_slope, ramp_slope, near_m, slope_length_m, noise_m, max_gap_m, flank_m, hidden_m;
    float max_rise_beside;
    float min_height_m, max_height_m, min_sqrt_range, max_sqrt_range; /* of the points that are used, exclusive */
    const i32 *low_sectors SHAPE(near_rings); /* sectors to the left and right that a low thing does not reach */
    i32 near_rings, rings_behind, quarters, n_gaps;
    const float *gaps SHAPE(n_gaps, 4); /* of dead beams: tangents of the elevations of gaps.py */
    float low_m, clear_m, foot_share, min_foot_m;
} Ground;

enum { BLOCK = 512, GROUP = 8 }; /* points in the first-level cache; points kept or left out together */
enum { POSITIONS = 1024 }; /* of a lowest return in its ring, in the last bits of its height */

/* What a point is compared with: the surface at the inner and the outer edge of its ring, and heights above it from
 * which the point is a foot, and clear of the ground. */
typedef enum { INNER, OUTER, FOOT, CLEAR, N_LEVELS } Level;

/* Scratch: a value a cell, a value a ray, and a value a point. */
typedef struct {
    float *lowest, *surface, *range_before; /* (cells,) range_before: of the ground cell before each cell [m] */
    float *clear;                           /* (cells,) height from which a return is clear of the ground */
    u4 *below;                              /* (cells,) Levels of the points of each cell */
    float (*ends)[2];                       /* (cells,) lowest return, and the highest, negated, side by side */
    uint8_t *kind;                          /* (cells,) flags of Kind */
    float *rays;                            /* (7 * sectors,) */
    uint8_t *may;                           /* (sectors,) Beside of the cells of a ring */
    float *z, *sqrt_range;                  /* (n,) */
    i32 *cell;                              /* (n + BLOCK,) */
    i64 *low_rows;                          /* (n + 1,) rows of the low points */
    float *low_height;                      /* (n + 1,) their heights above ground */
} GroundScratch;

/* Places the scratch for n points at `memory`; returns its size in bytes. */
static i64 place_scratch(const Ground *g, i64 n, void *memory, GroundScratch *s)
{
    uintptr_t end = (uintptr_t)memory;
    i64 cells = (i64)g->rings * g->sectors + 1;
    TAKE(&end, s->lowest, cells);
    TAKE(&end, s->surface, cells + g->sectors);
    TAKE(&end, s->range_before, cells);
    TAKE(&end, s->clear, cells);
    TAKE(&end, s->below, cells);
    TAKE(&end, s->ends, cells);
    TAKE(&end, s->kind, cells);
    TAKE(&end, s->rays, 7 * g->sectors);
    TAKE(&end, s->may, g->sectors);
    TAKE(&end, s->z, n);
    TAKE(&end, s->sqrt_range, n);
    TAKE(&end, s->cell, n + BLOCK);
    TAKE(&end, s->low_rows, n + 1);
    TAKE(&end, s->low_height, n + 1);
    return (i64)(end - (uintptr_t)memory);
}

EXPORT i64 modt_ground_scratch(const Ground *g, i64 n)
{
    GroundScratch s;
    return place_scratch(g, n, 0, &s);
}

typedef struct {
    i64 *rows SHAPE(room);           /* of the points kept; room for one more than there are points */
    float *kept[5] SHAPE(5, room);   /* x, y, z, square root of range, and height above ground */
    uint8_t *is_clear SHAPE(room);   /* low points that are clear of the roughness of the ground */
    float *top SHAPE(rings, sectors); /* highest return of each polar cell */
    int8_t *kind SHAPE(room);        /* PointKind of all points */
} AboveGround;

/* Flags of a cell: it is ground; its ray is on a ramp; that ray or one beside it is; something stands in it. */
typedef enum { GROUND = 1, STEEP = 2, RAMP = 4, STANDS = 8 } Kind;

/* The x, y and z of n points, four at a time. */
static ALWAYS_INLINE void take_columns(const u4 *points, i64 n, float *restrict x, float *restrict y,
                                       float *restrict z)
{
    i64 i = 0;
    for (; i + 4 <= n; i += 4) {
        u4 column[4];
        __builtin_prefetch(points + i + BLOCK); /* the processor itself looks ahead within a page only */
        transpose(points + i, column);
        *(u4 *)(x + i) = column[0];
        *(u4 *)(y + i) = column[1];
        *(u4 *)(z + i) = column[2];
    }
    for (; i < n; i++) {
        x[i] = points[i][0];
        y[i] = points[i][1];
        z[i] = points[i][2];
    }
}

/* PointColumns.from_array and PolarGrid.cell, of up to BLOCK points: z, square root of range, and cell of each.
 * Points that are not finite, or as far as far_m, are taken to the sensor. */
static void place_points(const Ground *g, const u4 *points, i64 n, float *restrict z, float *restrict sqrt_range,
                         i32 *restrict cell)
{
    float x[BLOCK], y[BLOCK];
    float far_m = g->far_m, last_ring = (float)(g->rings - 1);
    float sectors_per_unit = (float)g->sectors / 4.0f; /* of the pseudo-angle */
    i32 bits = __builtin_ctz((unsigned)g->sectors), mask = g->sectors - 1;
    take_columns(points, n, x, y, z);
    for (i64 i = 0; i < n; i++) {
        /* not a number is not below */
        int known = (magnitude(x[i]) < far_m) & (magnitude(y[i]) < far_m) & (magnitude(z[i]) < far_m);
        float here_x = known ? x[i] : 0.0f, here_y = known ? y[i] : 0.0f;
        z[i] = known ? z[i] : 0.0f;
        sqrt_range[i] = __builtin_sqrtf(__builtin_sqrtf(here_x * here_x + here_y * here_y));
        i32 ring = (i32)minf(sqrt_range[i] * g->rings_per_unit, last_ring);
        i32 sector = (i32)(pseudo_angle(here_x, here_y) * sectors_per_unit) & mask;
        cell[i] = (ring << bits) + sector;
    }
}

/* GroundEstimator._lowest and the highest returns of GroundEstimator.heights, of up to BLOCK points. Afterwards the
 * cell of points out of bounds of range, and of places of the block without a point, is the one after the last. */
static void find_ends(const Ground *g, float height_m, i64 n, const float *z, const float *sqrt_range, i32 *cell,
                      float (*ends)[2])
{
    enum { APART = BLOCK / 8 };
    float candidate[BLOCK][2];
    float positions_per_unit = g->rings_per_unit * POSITIONS;
    i32 outside = g->rings * g->sectors;
    /* 1. What each point offers its cell. */
    for (i64 i = 0; i < n; i++) {
        float reach = sqrt_range[i] * sqrt_range[i] * g->hill_slope + g->noise_m;
        int plausible = (magnitude(z[i] + height_m) < reach) & (sqrt_range[i] > g->min_sqrt_range);
        i32 position = (i32)(sqrt_range[i] * positions_per_unit) & (POSITIONS - 1);
        float placed = float_of((bits_of(z[i]) & ~(POSITIONS - 1)) | position);
        candidate[i][0] = plausible ? placed : INFINITY;
        candidate[i][1] = -z[i];
    }
    for (i64 i = n; i < BLOCK; i++) {
        cell[i] = outside;
        candidate[i][0] = candidate[i][1] = INFINITY;
    }
    /* 2. The least offer of each cell. */
    for (i64 k = 0; k < APART; k++) /* neighbours share cells: those far apart do not wait for one another */
        for (i64 i = k; i < BLOCK; i += APART) {
            PROVEN(cell[i] >= 0 && cell[i] <= outside);
            float *of_cell = ends[cell[i]];
            of_cell[0] = minf(candidate[i][0], of_cell[0]);
            of_cell[1] = minf(candidate[i][1], of_cell[1]);
        }
    /* 3. Points out of bounds of range have counted in steps 1 and 2, and are left out from here on. */
    for (i64 i = 0; i < n; i++) {
        int used = (sqrt_range[i] > g->min_sqrt_range) & (sqrt_range[i] < g->max_sqrt_range);
        cell[i] = used ? cell[i] : outside;
    }
}

/* Lower median of n numbers, which it sorts; infinite of none. */
static float median_of(float *numbers, i32 n)
{
    for (i32 i = 1; i < n; i++) {
        float number = numbers[i];
        i32 k = i;
        for (; k > 0 && numbers[k - 1] > number; k--)
            numbers[k] = numbers[k - 1];
        numbers[k] = number;
    }
    return n ? numbers[(n - 1) / 2] : INFINITY;
}

/* GroundEstimator.clear_m of the near rings, by the highest return of each cell. `rays` is scratch. */
static void measure_roughness(const Ground *g, const GroundScratch *s, const float *top)
{
    i32 in_quarter = g->sectors / g->quarters;
    float *ranges = s->rays;
    for (i32 first = 0; first < g->near_rings * g->sectors; first += in_quarter) {
        i32 n = 0;
        for (i32 k = first; k < first + in_quarter; k++) {
            ranges[n] = top[k] - s->ends[k][0]; /* overwritten by the next, unless there are returns and all lie flat */
            n += ranges[n] <= g->flat_m[first / g->sectors] && s->ends[k][0] < INFINITY;
        }
        float clear_m = g->clear_m + median_of(ranges, n);
        for (i32 k = first; k < first + in_quarter; k++)
            s->clear[k] = clear_m;
    }
}

/* GroundEstimator._across_gaps, of n points. */
static void reach_across(const Ground *g, const GroundScratch *s, i64 n)
{
    for (const float *gap = g->gaps; gap < g->gaps + 4 * g->n_gaps; gap += 4) /* EDGE, FIRST, LAST and TOP */
        for (i64 i = 0; i < n; i++) {
            float range_m = s->sqrt_range[i] * s->sqrt_range[i], *highest = &s->ends[s->cell[i]][1];
            int is_below = (s->z[i] > range_m * gap[0]) & (s->z[i] < range_m * gap[1]);
            *highest = is_below ? minf(-(range_m * gap[2]), *highest) : *highest;
        }
}

/* _position of ground.py: position of the lowest return of a cell in its ring, from 0 to 1. */
static ALWAYS_INLINE float position_of(float lowest)
{
    return (float)(bits_of(lowest) & (POSITIONS - 1)) * (1.0f / POSITIONS);
}

/* GroundEstimator.range_m: range of the lowest return of a cell of a ring. */
static ALWAYS_INLINE float range_of(float lowest, float ring, float ring_step)
{
    float sqrt_range = (ring + position_of(lowest)) * ring_step;
    return sqrt_range * sqrt_range;
}

/* _lowered of ground.py: the height of a lowest return less `by_m`, with its position. */
static ALWAYS_INLINE float lowered(float lowest, float by_m)
{
    return float_of((bits_of(lowest - by_m) & ~(POSITIONS - 1)) | (bits_of(lowest) & (POSITIONS - 1)));
}

/* A row of `size` bytes with `step` of them from its other end on either side, so that no index wraps. */
static void close_round(const void *row, i64 step, i64 size, void *round)
{
    __builtin_memcpy(round, (const char *)row + size - step, step);
    __builtin_memcpy((char *)round + step, row, size);
    __builtin_memcpy((char *)round + step + size, row, step);
}

/* What may become of a cell by the rays beside its own: ground, if it continues theirs; the foot of something, which
 * is hidden, if it does not; ground, if it is reached along the ring. REACHED: it is, or it begins there. */
typedef enum { MAY_JOIN = 1, MAY_HIDE = 2, MAY_BE_REACHED = 4, REACHED = 8 } Beside;

/* The first half of Rays.advance for one ring, behind which are the ends `behind`: cells that continue the ground of
 * their own rays, and cells in which something stands. `surface`: in, lowest return behind each cell; out, height of
 * the ground cell before it. The range of that cell is written to `range_before`, the height of cells that are surely
 * ground to `sure`. Something stands in a cell if its highest return lies flat_m above the lowest, and more
 * on ground that rises. */
static void follow_rays(const Ground *g, i32 ring, float (*restrict ends)[2], float (*restrict behind)[2],
                        float *restrict lowest, uint8_t *restrict kind, const float *restrict height,
                        const float *restrict range, const float *restrict slope, const float *restrict rise_range_m,
                        float *restrict sure, uint8_t *restrict may, float *restrict surface,
                        float *restrict range_before)
{
    const Ground c = *g; /* a copy, which no store through a pointer can change */
    float flat_m = c.flat_m[ring], depth_m = c.depth_m[ring];
    for (i32 k = 0; k < c.sectors; k++) {
        lowest[k] = ends[k][0];
        float gap = range_of(lowest[k], (float)ring, c.ring_step) - range[k];
        float residual = lowest[k] - height[k] - slope[k] * minf(gap, c.max_gap_m);
        float max_spread_m = flat_m + maxf(slope[k], 0.0f) * depth_m;
        int is_flat = -ends[k][1] - lowest[k] <= max_spread_m;
        int is_flat_behind = -behind[k][1] - lowest[k] <= max_spread_m;
        int stays_up = (surface[k] > lowest[k] - c.noise_m) & (surface[k] < INFINITY);
        int may_rise = is_flat & ((is_flat_behind & stays_up) | (range[k] > 0.0f));
        float bound = minf(gap, rise_range_m[k]) * c.max_slope * (may_rise ? 1.0f : 0.0f) + c.noise_m;
        int may_fall = residual > -(gap * c.max_slope + c.noise_m);
        int is_below = residual < -c.noise_m;
        int found = (residual < bound) & may_fall;
        int stands = may_fall & (is_flat == 0);
        surface[k] = height[k];
        range_before[k] = range[k];
        int is_sure = found & (is_flat | (is_below == 0));
        int is_reached = is_sure & ((range[k] > 0.0f) | (residual < c.noise_m));
        sure[k] = is_sure ? lowest[k] : NAN;
        int may_join = is_flat & (residual < gap * c.hill_slope);
        int may_hide = stands & is_below & (gap > c.near_m);
        may[k] = (uint8_t)(may_join * MAY_JOIN | may_hide * MAY_HIDE | (may_join & stays_up) * MAY_BE_REACHED |
                           is_reached * REACHED);
        kind[k] = (uint8_t)(found * GROUND | stands * STANDS);
    }
}

/* Rays._reached: ground goes on from cell to cell, in both directions along a ring. */
static void reach_along(const Ground *g, i32 ring, const float *lowest, uint8_t *may, float *sure, uint8_t *kind)
{
    i32 last = g->sectors - 1;
    uint8_t is_missed = 0; /* most often there is no such cell */
    for (i32 k = 0; k <= last; k++)
        is_missed |= kind[k] & GROUND ? 0 : may[k] & MAY_BE_REACHED;
    if (!is_missed)
        return;
    /* Forwards, then backwards: `last` cells ahead around the ring is one back. */
    for (i32 step = 1; step <= last; step += last - 1)
        for (i32 i = 0, k = 0; i < 2 * g->sectors; i++) { /* twice around: it may begin anywhere */
            i32 from = k;
            k = (k + step) & last;
            if (!(may[from] & REACHED) || !(may[k] & MAY_BE_REACHED))
                continue;
            float max_rise_m = range_of(lowest[k], (float)ring, g->ring_step) * g->max_rise_beside + g->noise_m;
            if (magnitude(lowest[k] - lowest[from]) < max_rise_m) {
                may[k] |= REACHED;
                kind[k] |= GROUND;
                sure[k] = lowest[k];
            }
        }
}

/* The second half of Rays.advance: what becomes of cells by `beside`, the sure ground from the ray before the first
 * to the ray after the last; and the rays after the ring. */
static void join_rays(const Ground *g, i32 ring, const float *restrict beside, const uint8_t *restrict may,
                      float *restrict lowest, uint8_t *restrict kind, float *restrict height, float *restrict range,
                      float *restrict slope)
{
    const Ground c = *g; /* a copy, which no store through a pointer can change */
    for (i32 k = 0; k < c.sectors; k++) {
        float here = lowest[k], range_m = range_of(here, (float)ring, c.ring_step);
        float max_rise_m = range_m * c.max_rise_beside;
        int continues = (magnitude(here - beside[k]) < max_rise_m) | (magnitude(here - beside[k + 2]) < max_rise_m);
        int found = ((kind[k] & GROUND) | (may[k] & (continues * MAY_JOIN))) != 0;
        here = may[k] & (continues ? 0 : MAY_HIDE) ? lowered(here, c.hidden_m) : here;
        float gap = range_m - range[k];
        float newest = slope[k] + (here - height[k] - slope[k] * gap) / (gap + c.slope_length_m);
        newest = minf(maxf(newest, -c.hill_slope), c.hill_slope);
        lowest[k] = here;
        height[k] = found ? here : height[k];
        range[k] = found ? range_m : range[k];
        slope[k] = found ? newest : slope[k];
        kind[k] = (uint8_t)(kind[k] | found * GROUND | (magnitude(slope[k]) > c.ramp_slope) * STEEP);
    }
}

/* GroundEstimator._lowest_behind, in `surface`. */
static void look_behind(const Ground *g, const GroundScratch *s)
{
    i32 sectors = g->sectors, near_end = g->near_rings * sectors, end = g->rings * sectors;
    for (i32 row = 0; row < end; row += sectors) {
        float *restrict lowest = s->surface + row;
        i32 last = row + g->rings_behind * sectors;
        for (i32 k = 0; k < sectors; k++)
            lowest[k] = INFINITY;
        for (i32 behind = row + sectors; behind <= last && behind < near_end; behind += sectors)
            for (i32 k = 0; k < sectors; k++)
                lowest[k] = minf(s->ends[behind + k][0], lowest[k]);
    }
}

/* GroundEstimator.trace. */
static void trace(const Ground *g, float height_m, const GroundScratch *s)
{
    i32 sectors = g->sectors, flank = g->flank_sectors;
    float *height = s->rays, *range = height + sectors, *slope = range + sectors, *rise_range_m = slope + sectors;
    float *sure = rise_range_m + sectors, *beside = sure + sectors;
    float near_m = g->near_m, max_gap_m = g->max_gap_m;
    look_behind(g, s);
    for (i32 k = 0; k < sectors; k++) {
        height[k] = -height_m;
        range[k] = 0.0f;
        slope[k] = 0.0f;
        rise_range_m[k] = near_m;
    }
    for (i32 ring = 0; ring < g->rings; ring++) {
        i32 row = ring * sectors;
        uint8_t *kind = s->kind + row;
        uint8_t *round = (uint8_t *)(s->ends + row); /* the ends of this ring are needed no more */
        float (*behind)[2] = ring + 1 < g->rings ? s->ends + row + sectors : s->ends + row;
        follow_rays(g, ring, s->ends + row, behind, s->lowest + row, kind, height, range, slope, rise_range_m, sure,
                    s->may, s->surface + row, s->range_before + row);
        if (ring < g->near_rings)
            reach_along(g, ring, s->lowest + row, s->may, sure, kind);
        close_round(sure, sizeof *sure, sectors * sizeof *sure, beside);
        join_rays(g, ring, beside, s->may, s->lowest + row, kind, height, range, slope);
        close_round(kind, flank, sectors, round);
        for (i32 k = 0; k < sectors; k++) {
            i32 steep = (round[k] | round[k + flank] | round[k + 2 * flank]) & STEEP;
            kind[k] = (uint8_t)(kind[k] | (steep ? RAMP : 0));
            rise_range_m[k] = steep ? max_gap_m : near_m;
        }
    }
}

/* The inner edge of a ring of GroundEstimator._interpolate. The ground cell before it is in `surface` and
 * `range_before`; the one after it, in `height` and `range`, is updated with the cells of this ring. NONE as its
 * range means that there is none, and the ray goes on with `slope`. */
static void blend(const Ground *g, i32 ring, const uint8_t *restrict kind, float *restrict height,
                  float *restrict range, const float *restrict slope, const float *restrict lowest,
                  float *restrict surface, const float *restrict range_before)
{
    const Ground c = *g; /* a copy, which no store through a pointer can change */
    float edge_m = c.edge_m[ring];
    for (i32 k = 0; k < c.sectors; k++) {
        float range_m = range_of(lowest[k], (float)ring, c.ring_step);
        float to = kind[k] & GROUND ? lowest[k] : height[k];
        float to_range = kind[k] & GROUND ? range_m : range[k];
        float from = surface[k];
        float since = edge_m - range_before[k];
        float between = from + (to - from) * (since / maxf(to_range - range_before[k], 1e-3f));
        float ramp = from + slope[k] * minf(since, c.max_gap_m);
        float beyond = minf(ramp, maxf(lowest[k], from)); /* a ramp rises above no return */
        height[k] = to;
        range[k] = to_range;
        surface[k] = to_range < 0.0f ? beyond : between;
    }
}

/* GroundEstimator._interpolate, from the last ring inwards: linear from the ground cell before each edge to the
 * one after it, or on with the slope of its ramp. `rays` comes from trace. */
static void interpolate(const Ground *g, const GroundScratch *s)
{
    i32 sectors = g->sectors;
    float *height = s->rays, *range = height + sectors, *slope = range + sectors;
    for (i32 k = 0; k < sectors; k++) {
        range[k] = NONE;
        slope[k] = magnitude(slope[k]) > g->ramp_slope ? slope[k] : 0.0f;
    }
    for (i32 ring = g->rings - 1, row = ring * sectors; ring >= 0; ring--, row -= sectors)
        blend(g, ring, s->kind + row, height, range, slope, s->lowest + row, s->surface + row, s->range_before + row);
}

/* _median_across, in a row of cells; `round` is scratch. */
static void median_across(i32 sectors, i32 step, const float *row, float *restrict round, float *restrict median)
{
    close_round(row, step * sizeof *row, sectors * sizeof *row, round);
    for (i32 k = 0; k < sectors; k++) {
        float left = round[k], here = round[k + step], right = round[k + 2 * step];
        median[k] = maxf(minf(left, here), minf(maxf(left, here), right));
    }
}

/* The end of GroundEstimator.heights: medians across the rays, the ground beside what stands on it,
 * _leave_low_things and _below_what_stands. */
static void smooth(const Ground *g, const GroundScratch *s, const float *top)
{
    i32 sectors = g->sectors, cells = g->rings * sectors;
    float *median = s->rays, *beside = median + sectors, *beyond = beside + sectors;
    float *round = beyond + sectors; /* two rows */
    /* From the last ring inwards: the outer edge of a ring is the inner edge of the one after it, smoothed already. */
    for (i32 row = cells - sectors; row >= 0; row -= sectors) {
        float *surface = s->surface + row;
        median_across(sectors, 1, surface, round, median);
        median_across(sectors, g->flank_sectors, median, round, beside);
        for (i32 k = 0; k < sectors; k++) {
            int on_ramp = s->kind[row + k] & RAMP;
            int hidden = on_ramp ? median[k] < beside[k] : median[k] - beside[k] > g->flank_m;
            surface[k] = hidden ? beside[k] : median[k];
        }
        if (row < g->near_rings * sectors) {
            i32 low_sectors = g->low_sectors[row / sectors], quarter = sectors / 4;
            median_across(sectors, low_sectors, surface, round, beside);
            median_across(sectors, 2 * low_sectors < quarter ? 2 * low_sectors : quarter, surface, round, beyond);
            for (i32 k = 0; k < sectors; k++) {
                float fall_m = minf(maxf(beside[k] - beyond[k], 0.0f), g->low_m);
                int raised = surface[k] - beside[k] > g->low_m + fall_m && !(s->kind[row + k] & RAMP);
                surface[k] = raised ? beside[k] : surface[k];
            }
        }
        for (i32 k = row; k < row + sectors; k++) {
            float inner = s->surface[k], outer = s->surface[k + sectors], lowest = s->lowest[k];
            float above_m = inner + (outer - inner) * position_of(lowest) - lowest;
            float drop_m = s->kind[k] & STANDS && above_m > g->noise_m ? above_m : 0.0f;
            inner -= drop_m;
            int is_clear = row < g->near_rings * sectors && top[k] - inner > s->clear[k];
            float foot = is_clear ? maxf(g->foot_share * s->clear[k], g->min_foot_m) : INFINITY;
            s->below[k] = (u4){inner, outer - drop_m, foot, is_clear ? s->clear[k] : INFINITY};
        }
    }
}

/* Kernels.above_ground, of up to BLOCK points from `start` on: those within bounds of height are written from
 * `count` on, where there is room for one more. Returns how many there are then. Low ones go to the scratch from
 * `n_low` on. A point that is out of range has no height: its surface is infinite. */
static i64 keep_points(const Ground *g, const GroundScratch *s, const u4 *points, i64 start, i64 n, i64 count,
                       i64 *n_low, const AboveGround *out)
{
    const uint64_t all = 0x0101010101010101;
    const i32 *cell = s->cell + start, bits = __builtin_ctz((unsigned)g->sectors);
    float *const *kept = out->kept;
    int8_t *kind = out->kind + start;
    float below[N_LEVELS][BLOCK], height[BLOCK], low = g->min_height_m, high = g->max_height_m;
    uint8_t is_kept[BLOCK + GROUP] = {0}, is_low[BLOCK + GROUP] = {0}; /* the last group may reach beyond n */
    uint8_t is_clear[BLOCK];
    /* 1. The surface of the cell of each point, by columns. */
    for (i64 i = 0; i < BLOCK; i += 4) {
        u4 of_point[4], column[4];
        for (int k = 0; k < 4; k++)
            of_point[k] = s->below[cell[i + k]];
        transpose(of_point, column);
        for (int v = 0; v < N_LEVELS; v++)
            *(u4 *)(below[v] + i) = column[v];
    }
    /* 2. Heights, and from them the kinds. An infinite surface gives a height of -infinity: out of range. */
    for (i64 i = 0; i < n; i++) {
        float share = s->sqrt_range[start + i] * g->rings_per_unit - (float)(cell[i] >> bits);
        height[i] = s->z[start + i] - (below[INNER][i] + (below[OUTER][i] - below[INNER][i]) * share);
    }
    for (i64 i = 0; i < n; i++) {
        int is_known = height[i] > -INFINITY, is_over = height[i] >= high;
        int is_above = (height[i] > low) & (height[i] < high);
        kind[i] = (int8_t)(OUT_OF_RANGE_KIND + is_known * (GROUND_KIND - OUT_OF_RANGE_KIND) +
                           is_over * (OVERHEAD_KIND - GROUND_KIND) + is_above * (MEMBER_KIND - GROUND_KIND));
        is_kept[i] = (uint8_t)is_above;
        is_low[i] = (height[i] <= low) & (height[i] > below[FOOT][i]);
        is_clear[i] = height[i] > below[CLEAR][i];
    }
    /* 3. Those kept are written a group at a time where all or none of it stay, which is most often so. */
    for (i64 first = 0; first < n; first += GROUP) {
        i64 row = start + first;
        uint64_t kept_group, low_group;
        __builtin_memcpy(&kept_group, is_kept + first, GROUP);
        __builtin_memcpy(&low_group, is_low + first, GROUP);
        for (i64 i = first; low_group && i < first + GROUP; i++) {
            s->low_rows[*n_low] = start + i; /* overwritten by the next, unless it is low */
            s->low_height[*n_low] = height[i];
            out->is_clear[*n_low] = is_clear[i];
            *n_low += is_low[i];
        }
        if (kept_group == all) {
            for (i64 i = 0; i < GROUP; i++)
                out->rows[count + i] = row + i;
            take_columns(points + row, GROUP, kept[0] + count, kept[1] + count, kept[2] + count);
            __builtin_memcpy(kept[3] + count, s->sqrt_range + row, GROUP * sizeof(float));
            __builtin_memcpy(kept[4] + count, height + first, GROUP * sizeof(float));
            count += GROUP;
        } else if (kept_group) /* most often there is none: ground */
            for (i64 i = first; i < first + GROUP && i < n; i++, row++) {
                out->rows[count] = row; /* overwritten by the next, unless it stays */
                for (int v = 0; v < 3; v++)
                    kept[v][count] = points[row][v];
                kept[3][count] = s->sqrt_range[row];
                kept[4][count] = height[i];
                count += is_kept[i];
            }
    }
    return count;
}

/* The low points, after the `count` others. */
static void append_low(const GroundScratch *s, const u4 *points, i64 count, i64 n_low, const AboveGround *out)
{
    float *const *kept = out->kept;
    for (i64 k = 0; k < n_low; k++) {
        i64 row = s->low_rows[k], at = count + k;
        out->rows[at] = row;
        for (int v = 0; v < 3; v++)
            kept[v][at] = points[row][v];
        kept[3][at] = s->sqrt_range[row];
        kept[4][at] = s->low_height[k];
    }
}

/* Kernels.above_ground: of n points, x, y, z and reflectance of each, those within bounds, and the tops of the
 * cells. Counts those within bounds, and the low ones after them. `height_m` is that of the
 * sensor above ground. */
EXPORT void modt_above_ground(const Ground *g, const u4 *points, i64 n, float height_m, void *memory,
                              const AboveGround *out, i64 counts[2])
{
    i64 cells = g->rings * g->sectors, count = 0, n_low = 0;
    GroundScratch scratch, *s = &scratch;
    place_scratch(g, n, memory, s);
    for (i64 k = 0; k <= cells; k++)
        s->ends[k][0] = s->ends[k][1] = INFINITY;
    for (i64 i = 0; i < n; i += BLOCK) {
        i64 m = n - i < BLOCK ? n - i : BLOCK;
        place_points(g, points + i, m, s->z + i, s->sqrt_range + i, s->cell + i);
        find_ends(g, height_m, m, s->z + i, s->sqrt_range + i, s->cell + i, s->ends);
    }
    for (i64 k = 0; k < cells; k++)
        out->top[k] = -s->ends[k][1]; /* before the next passes raise it */
    measure_roughness(g, s, out->top);
    reach_across(g, s, n);
    /* GroundEstimator._tops, in place; ascending, so that each cell reads a ring that is not yet raised. */
    for (i64 k = (i64)g->bonnet_ring * g->sectors; k < cells - g->sectors; k++)
        s->ends[k][1] = minf(s->ends[k][1], s->ends[k + g->sectors][1]);
    trace(g, height_m, s);
    interpolate(g, s);
    smooth(g, s, out->top);
    s->below[cells] = spread(INFINITY); /* points out of bounds of range have no height */
    for (i64 i = 0; i < n; i += BLOCK)
        count = keep_points(g, s, points, i, n - i < BLOCK ? n - i : BLOCK, count, &n_low, out);
    append_low(s, points, count, n_low, out);
    counts[0] = count;
    counts[1] = n_low;
}
