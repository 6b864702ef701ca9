/* Cells of a grid: which are occupied, which are connected, and which clusters of them are one car. */
#include "kernels.h"

#define FAR_M 1e6f /* of grids.py */
enum { LEVELS_PER_M = 10, N_LEVELS = 31, BLOCK_CELLS = 3 }; /* of overhang.py */

/* Cells of cells.py: n occupied cells of a square grid. */
typedef struct {
    i32 *row, *column SHAPE(n);
    i32 *levels SHAPE(n);       /* levels of height with a point, a bit each */
    float *low, *high SHAPE(n); /* least and greatest height of the points above ground [m] */
    i64 *entries SHAPE(n);      /* points in each */
} Cells;

/* --------------------------------------------------------------------------------------- occupied cells of points */

/* SqrtRangeGrid: cells of a side of 1 / cells_per_unit [sqrt(m)]. */
typedef struct {
    float cells_per_unit;
    i32 centre, side;
    i32 *table SHAPE(side, side); /* scratch: a number for each cell */
} Grid;

/* Place of a cell in the table of a grid whose side is a multiple of four. Blocks of 4x4 cells share a cache line,
 * since points that follow one another lie in neighbouring cells. */
static ALWAYS_INLINE i32 place_in_table(i32 row, i32 column, i32 side)
{
    return (row >> 2) * (4 * side) + (column >> 2) * 16 + (row & 3) * 4 + (column & 3);
}

/* SqrtRangeGrid.row_column for one coordinate; `scale` is cells_per_unit over the square root of the point's
 * range. */
static ALWAYS_INLINE i32 line_of(float x, float scale, i32 centre) { return (i32)(x * scale + (float)centre); }

/* occupied_cells: the cells of n points, in the order of their last points. Returns how many there are, C; they
 * are the first of the n places of `sample`, the row of the last point of each, of `sampled`, that point, and of
 * `cells`.
 *
 * Neither sorts nor searches. Each point writes its number into its cell of the table; the numbers left are the
 * last points. Then the table takes the numbers of the cells, and each point looks its own up. */
EXPORT i64 modt_occupied_cells(const PointColumns *points, const float *height, i64 n, const Grid *grid, i64 *sample,
                               const PointColumns *sampled, i64 *cell_of_point, const Cells *cells)
{
    i64 *const cell = cell_of_point; /* until the last pass the place in the table */
    i32 *const table = grid->table;
    const i32 centre = grid->centre, side = grid->side;
    i32 count = 0;
    /* 1. The place of each point, which it claims: the last of a cell keeps it. */
    for (i64 i = 0; i < n; i++) {
        float scale = grid->cells_per_unit / points->sqrt_range[i];
        cell[i] = place_in_table(line_of(points->x[i], scale, centre), line_of(points->y[i], scale, centre), side);
    }
    for (i64 i = 0; i < n; i++) {
        PROVEN(cell[i] >= 0 && cell[i] < side * side);
        __builtin_prefetch(&table[cell[i + AHEAD < n ? i + AHEAD : i]], 1);
        table[cell[i]] = (i32)i;
    }
    /* 2. Those last points are the samples. Their cells begin with them, and are numbered in the table. */
    for (i64 i = 0; i < n; i++) {
        sample[count] = i; /* overwritten by the next, unless it is the last one of its cell */
        count += table[cell[i]] == i;
    }
    for (i32 c = 0; c < count; c++) {
        i64 last = sample[c];
        sampled->x[c] = points->x[last];
        sampled->y[c] = points->y[last];
        sampled->z[c] = points->z[last];
        sampled->sqrt_range[c] = points->sqrt_range[last];
        cells->low[c] = height[last];
        cells->high[c] = height[last];
        cells->entries[c] = 0;
        cells->levels[c] = 0;
        table[cell[last]] = c;
    }
    /* 3. Every point looks up the number of its cell, and extends it. */
    float *low = cells->low, *high = cells->high;
    for (i64 i = 0; i < n; i++) {
        i64 c = cell[i] = table[cell[i]];
        float here = height[i];
        low[c] = minf(here, low[c]);
        high[c] = maxf(here, high[c]);
        cells->levels[c] |= 1 << (i32)minf(maxf(here * (float)LEVELS_PER_M, 0.0f), N_LEVELS - 1);
        cells->entries[c]++;
    }
    for (i32 c = 0; c < count; c++) {
        float scale = grid->cells_per_unit / sampled->sqrt_range[c];
        cells->row[c] = line_of(sampled->x[c], scale, centre);
        cells->column[c] = line_of(sampled->y[c], scale, centre);
    }
    return count;
}

/* PorosityFinder: bounds on what is airborne. */
typedef struct {
    float min_solidity;         /* of a window that is solid */
    float reach_m, reach_beams; /* of the window of a point, below and above it [m; beam spacings] */
    float max_sqrt_range;       /* range within which cells are looked at [sqrt(m)] */
    float point_sqrt_range;     /* the same of points */
} PorosityRules;

/* Cells of a grid, which are looked up by their places in the table. */
typedef struct {
    i32 *table, *place; /* (side * side,) cell at each place, among other numbers; (n,) place of each cell */
    i32 side, n;
} CellMap;

static CellMap map_of(const Grid *grid, const Cells *cells, i32 n, i32 *place)
{
    CellMap map = {grid->table, place, grid->side, n};
    for (i32 c = 0; c < n; c++) {
        place[c] = cells->row[c] * map.side + cells->column[c];
        PROVEN(place[c] > map.side && place[c] < map.side * map.side - map.side - 1);
        map.table[place[c]] = c;
    }
    return map;
}

/* Cell at a place of the table, or NONE. Numbers of an earlier use name no cell, or one of another place. */
static ALWAYS_INLINE i32 cell_at(const CellMap *map, i32 at)
{
    i32 c = map->table[at];
    return c >= 0 && c < map->n && map->place[c] == at ? c : NONE;
}

/* PorosityFinder._rays_across */
static ALWAYS_INLINE float columns_at(float rays_sqrt_range, float sqrt_range)
{
    return maxf(rays_sqrt_range / sqrt_range, 1.0f);
}

/* Square part of a grid around the sensor that holds all cells that are looked at, with those beside them. Between
 * calls all are empty. */
typedef struct {
    i32 side, first;                     /* cells of a side; row and column of the first in the grid */
    i32 *returns SHAPE(side, side);      /* points of each cell, 0 of an empty one */
    float *low, *high SHAPE(side, side); /* least and greatest height in each [m]; infinities of an empty one */
    float *solidity SHAPE(side, side);   /* 0 of an empty one */
} NearCells;

/* Place of a cell among the near ones, or NONE */
static ALWAYS_INLINE i32 near_place(const NearCells *near, const Cells *cells, i32 c)
{
    i32 row = cells->row[c] - near->first, column = cells->column[c] - near->first;
    int inside = row >= 0 && row < near->side && column >= 0 && column < near->side;
    return inside ? row * near->side + column : NONE;
}

/* Solidity of the window around a near cell with this many rays of a beam */
static ALWAYS_INLINE float window_solidity(const NearCells *near, i32 at, float columns, float beam_m)
{
    i32 returns = 0;
    float low = INFINITY, high = -INFINITY;
    for (i32 k = at - near->side; k <= at + near->side; k += near->side) {
        returns += near->returns[k - 1] + near->returns[k] + near->returns[k + 1];
        low = minf(low, minf(near->low[k - 1], minf(near->low[k], near->low[k + 1])));
        high = maxf(high, maxf(near->high[k - 1], maxf(near->high[k], near->high[k + 1])));
    }
    return returns > 1 ? (float)returns / (columns * ((high - low) / beam_m + 1.0f)) : 0.0f;
}

/* PorosityFinder.air of n cells: returns the number of returns in airborne cells, of the number looked at, which is
 * written. Scratch: `place`, (n,). */
EXPORT i64 modt_air(const PorosityRules *r, const NearCells *near, const Cells *cells, const float *sqrt_range,
                    const float *beam_m, float rays_sqrt_range, i32 n, i32 *place, float *solidity, uint8_t *airborne,
                    i64 *looked_at)
{
    for (i32 c = 0; c < n; c++) {
        i32 at = place[c] = near_place(near, cells, c);
        if (at == NONE)
            continue;
        near->returns[at] = (i32)cells->entries[c];
        near->low[at] = cells->low[c];
        near->high[at] = cells->high[c];
    }
    i64 of_air = 0;
    *looked_at = 0;
    for (i32 c = 0; c < n; c++) {
        i32 at = place[c];
        int is_near = sqrt_range[c] < r->max_sqrt_range;
        PROVEN(!is_near || (at > near->side && at < near->side * near->side - near->side - 1));
        solidity[c] = is_near ? window_solidity(near, at, columns_at(rays_sqrt_range, sqrt_range[c]), beam_m[c]) : 1.0f;
        *looked_at += is_near ? cells->entries[c] : 0;
        if (at != NONE)
            near->solidity[at] = solidity[c];
    }
    for (i32 c = 0; c < n; c++) {
        airborne[c] = 0;
        if (!(solidity[c] < r->min_solidity))
            continue;
        const float *middle = near->solidity + place[c];
        float most = 0.0f;
        for (i32 k = -1; k <= 1; k++)
            most = maxf(most, maxf(maxf(middle[k - near->side], middle[k]), middle[k + near->side]));
        airborne[c] = most < r->min_solidity;
        of_air += airborne[c] ? cells->entries[c] : 0;
    }
    for (i32 c = 0; c < n; c++) {
        i32 at = place[c];
        if (at == NONE)
            continue;
        near->returns[at] = 0;
        near->low[at] = INFINITY;
        near->high[at] = -INFINITY;
        near->solidity[at] = 0.0f;
    }
    return of_air;
}

/* mean_solidity of porosity.py, of n labels of n_cells cells. Scratch: `count`, (n,). */
EXPORT void modt_mean_solidity(const i64 *entries, const float *solidity, const i64 *label, i64 n_cells, i64 n,
                               double *count, double *mean)
{
    for (i64 k = 0; k < n; k++)
        count[k] = mean[k] = 0.0;
    for (i64 c = 0; c < n_cells; c++) {
        PROVEN(label[c] >= 0 && label[c] < n);
        double points = (double)entries[c];
        count[label[c]] += points;
        mean[label[c]] += points * (double)solidity[c];
    }
    for (i64 k = 0; k < n; k++)
        mean[k] = count[k] > 0.0 ? mean[k] / count[k] : 1.0;
}

/* Sorts the points of the `wanted` of n cells by cell: the rows of cell c, and their heights, are those from first[c]
 * to before first[c + 1]. */
static void sort_points(const uint8_t *wanted, i32 n, const i64 *cell_of_point, const float *height, i64 n_points,
                        i32 *first, i32 *rows, float *height_of_row)
{
    for (i32 c = 0; c <= n; c++)
        first[c] = 0;
    for (i64 i = 0; i < n_points; i++) {
        PROVEN(cell_of_point[i] >= 0 && cell_of_point[i] < n);
        first[cell_of_point[i]] += wanted[cell_of_point[i]];
    }
    for (i32 c = 1; c <= n; c++)
        first[c] += first[c - 1]; /* where the next cell begins, until all its points are placed, the last one first */
    for (i64 i = n_points - 1; i >= 0; i--) {
        i64 c = cell_of_point[i];
        if (!wanted[c])
            continue;
        i32 at = --first[c];
        rows[at] = (i32)i;
        height_of_row[at] = height[i];
    }
}

/* Occupied cells among the nine around a place; returns how many there are. */
static ALWAYS_INLINE i32 cells_around(const CellMap *map, i32 place, i32 around[9])
{
    i32 n = 0;
    for (i32 row = -map->side; row <= map->side; row += map->side)
        for (i32 column = -1; column <= 1; column++) {
            i32 c = cell_at(map, place + row + column);
            if (c != NONE)
                around[n++] = c;
        }
    return n;
}

/* PorosityFinder.airborne_points: whether each of n_points points is airborne. Scratch: `place` and `wanted`, (n,),
 * `first`, (n + 1,), and `rows` and `height_of_row` of all points. */
EXPORT void modt_airborne_points(const PorosityRules *r, const Grid *grid, const Cells *cells, const float *sqrt_range,
                                 const float *beam_m, const uint8_t *airborne, float rays_sqrt_range, i32 n,
                                 const i64 *cell_of_point, const float *height, i64 n_points, i32 *place,
                                 uint8_t *wanted, i32 *first, i32 *rows, float *height_of_row, uint8_t *is_air)
{
    const CellMap map = map_of(grid, cells, n, place);
    i32 around[9];
    for (i32 c = 0; c < n; c++)
        wanted[c] = 0;
    for (i32 c = 0; c < n; c++)
        if (!airborne[c] && sqrt_range[c] < r->point_sqrt_range)
            for (i32 n_around = cells_around(&map, place[c], around), a = 0; a < n_around; a++)
                wanted[around[a]] = 1;
    sort_points(wanted, n, cell_of_point, height, n_points, first, rows, height_of_row);
    for (i64 i = 0; i < n_points; i++)
        is_air[i] = airborne[cell_of_point[i]];
    for (i32 c = 0; c < n; c++) {
        if (airborne[c] || !(sqrt_range[c] < r->point_sqrt_range))
            continue;
        float reach_m = maxf(r->reach_m, r->reach_beams * beam_m[c]);
        float columns = columns_at(rays_sqrt_range, sqrt_range[c]);
        float enough = r->min_solidity * columns * (2.0f * reach_m / beam_m[c] + 1.0f);
        i32 n_around = cells_around(&map, place[c], around);
        for (i32 k = first[c]; k < first[c + 1]; k++) {
            i32 count = 0;
            for (i32 a = 0; a < n_around && (float)count < enough; a++)
                for (i32 other = first[around[a]]; other < first[around[a] + 1]; other++)
                    count += magnitude(height_of_row[k] - height_of_row[other]) <= reach_m;
            is_air[rows[k]] = (float)count < enough;
        }
    }
}

/* Above.without: the points that are not airborne among n_tall tall ones, then the other n - n_tall, as rows of the
 * sweep with their columns and heights; returns how many there are. */
EXPORT i64 modt_without(const i64 *rows, const PointColumns *points, const float *height, const uint8_t *is_air,
                        i64 n_tall, i64 n, int8_t *kind, i64 *kept_rows, const PointColumns *kept, float *kept_height)
{
    i64 count = 0;
    for (i64 i = 0; i < n; i++) {
        if (i < n_tall && is_air[i]) {
            kind[rows[i]] = AIRBORNE_KIND;
            continue;
        }
        kept_rows[count] = rows[i];
        kept->x[count] = points->x[i];
        kept->y[count] = points->y[i];
        kept->z[count] = points->z[i];
        kept->sqrt_range[count] = points->sqrt_range[i];
        kept_height[count++] = height[i];
    }
    return count;
}

/* low_points: places of what may be low things or feet, and of a tall point beside each, or NONE; returns how many
 * there are. `sqrt_range` and `sample` are those of the tall cells. Scratch: `is_left_over`, of these.
 *
 * In the table stands what is in each wide cell: the place of a tall point, CLEAR if there is none but a low point
 * that is clear of the ground, else NONE. */
EXPORT i64 modt_low_points(const Grid *grid, const PointColumns *points, const uint8_t *is_clear, const Clusters *tall,
                           const Cells *cells, const float *sqrt_range, const i64 *sample, i64 n_low,
                           float max_sqrt_range, uint8_t *is_left_over, i64 *places, i64 *beside)
{
    enum { CLEAR = -2 };
    i32 *const table = grid->table;
    const i32 centre = grid->centre, side = grid->side / 2 + 1;
    const i64 n_tall = tall->n_points;
    i64 n = 0, used;
    /* 1. Empty the part of the table that the points reach, and enter what stands. */
    float reach = max_sqrt_range; /* of all points that are looked at */
    for (i64 i = n_tall; i < n_tall + n_low; i++)
        reach = maxf(reach, points->sqrt_range[i]);
    i32 half = (i32)(reach * grid->cells_per_unit) / 2 + 2, first = centre / 2 > half ? centre / 2 - half : 0;
    i32 end = centre / 2 + half < side ? centre / 2 + half + 1 : side;
    for (i32 row = first; row < end; row++)
        for (i32 column = first; column < end; column++)
            table[row * side + column] = NONE;
    for (i64 c = 0; c < tall->n_cells; c++) {
        int8_t kind = sqrt_range[c] < max_sqrt_range ? tall->kind_of_cell[c] : GROUND_KIND;
        is_left_over[c] = (kind == LOW_KIND) | (kind == SPARSE_KIND);
        if (kind == MEMBER_KIND || kind == STRUCTURE_KIND)
            table[(cells->row[c] >> 1) * side + (cells->column[c] >> 1)] = (i32)sample[c];
    }
    /* 2. Candidates: tall points that are left over, then all low ones, each with its wide cell. */
    for (i64 i = 0; i < n_tall; i++) {
        places[n] = i; /* overwritten by the next, unless it is left over */
        n += is_left_over[tall->cell_of_point[i]];
    }
    for (i64 k = 0; k < n_low; k++)
        places[n + k] = n_tall + k;
    for (i64 p = 0; p < n + n_low; p++) {
        i64 i = places[p];
        float scale = grid->cells_per_unit / points->sqrt_range[i];
        i32 row = line_of(points->x[i], scale, centre) >> 1, column = line_of(points->y[i], scale, centre) >> 1;
        PROVEN(row > first && row < end - 1 && column > first && column < end - 1);
        beside[p] = row * side + column; /* until the last pass the wide cell */
        if (i >= n_tall && is_clear[i - n_tall] && table[beside[p]] == NONE)
            table[beside[p]] = CLEAR;
    }
    /* 3. Of the low ones those stay whose wide cell holds something. */
    used = n;
    for (i64 p = n; p < n + n_low; p++) {
        places[used] = places[p]; /* overwritten by the next, unless it is used */
        beside[used] = beside[p];
        used += table[beside[p]] != NONE;
    }
    /* 4. What stands in or beside the wide cell: CLEAR and NONE are less than any place. */
    for (i64 p = 0; p < used; p++) {
        const i32 *wide = table + beside[p];
        i32 greatest = NONE;
        for (i32 row = -side; row <= side; row += side)
            for (i32 column = -1; column <= 1; column++)
                greatest = wide[row + column] > greatest ? wide[row + column] : greatest;
        beside[p] = greatest;
    }
    return used;
}

/* ------------------------------------------------------------------------------------------- connected components */

/* Rem's union of the trees of a and b: a parent is never greater than its child, so a root is the least of its
 * component. Climbs from both at once, always from the one with the greater parent, and splices it below the
 * other's. */
static void join(i32 *parent, i32 a, i32 b)
{
    while (parent[a] != parent[b]) {
        if (parent[a] < parent[b]) {
            i32 c = a;
            a = b;
            b = c;
        }
        i32 above = parent[a];
        parent[a] = parent[b];
        if (above == a)
            return;
        a = above;
    }
}

/* A cell in a grid of a side below 2^16. */
typedef struct {
    uint16_t row, column;
    i32 rank; /* among the cells in use */
} Place;

/* A wide cell, in the order of the grid. */
typedef struct {
    i32 place;       /* row * side + column */
    float low, high; /* height [m] */
    float max_gap_m; /* vertical gap below which it is connected with those after it */
} Span;
enum { PLACE, LOW, HIGH, MAX_GAP }; /* members of a span, as a row of four */

static ALWAYS_INLINE u4 as_row(const Span *span)
{
    u4 row;
    __builtin_memcpy(&row, span, sizeof row);
    return row;
}

/* Scratch of modt_cluster, for n cells and a fine grid of `side` rows. The coarse grid has no more rows, so that the
 * scratch serves both. Some of the cells are used, in ascending order; the number of one among these is its rank. A
 * cell is called wide on the grid in use, which may be twice as wide. Spans and the arrays beside them begin at 1: span
 * 0 is nowhere. */
typedef struct {
    float *max_gap_m;               /* (n,) vertical gap below which a cell is connected */
    i32 *used;                      /* (n,) cells in use, by rank */
    i64 *part;                      /* (n,) part on the fine grid of each of these */
    uint8_t *divided;               /* (n,) whether a cluster is divided into parts */
    i32 *cluster_of_part;           /* (n,) number of the cluster that a part becomes, NONE if it does not leave */
    u4 (*ends)[2];                  /* (n,) least and greatest x, y and height of a cluster */
    i32 *next_in_row;               /* (side,) counts of the radix sort, then where the next of a row goes */
    i32 *next_in_column;            /* (side,) the same of columns */
    i32 *latest;                    /* (side,) latest span of each column, see find_components */
    Place *by_rank, *by_column;     /* (n,) places in the order of cells and of columns */
    Place *by_row;                  /* (n,) and of the grid: by row, then column, then cell */
    Span *spans;                    /* (n + 2,) room for an empty one */
    i32 *parent;                    /* (n + 1,) a span of the same component, not after it */
    i32 *last_rank;                 /* (n + 1,) rank of the last cell of each span */
    i32 *span_of_rank;              /* (n,) */
    i32 *component_of_root;         /* (n + 1,) number of the component of a span that is its own parent */
    i32 *next_of_cluster;           /* (2 n,) where the next cell of a cluster goes that may have surfaces, or NONE */
    i32 *cell_of_row;               /* (n,) cells of those clusters, in their order */
    i32 *row_cells;                 /* (n,) cells of one cluster that surfaces are looked for in */
    double *x, *y, *width_m;        /* (n,) these cells, as find_surfaces takes them */
    uint8_t *on_surface;            /* (n,) its results */
    double *distance_m;             /* (n,) */
    uint8_t *is_free;               /* (n,) whether a cell of a cluster with surfaces, or below a canopy, is on none */
    float *before_m;                /* (n,) distance of a free cell before surfaces, infinite where none reaches */
    float *surface_top_m;           /* (n,) greatest height of the surfaces of its cluster, infinite without any */
    float *front_m, *back_m;        /* (n,) greatest and least of those of each part */
    float *top_m;                   /* (n,) height up to which a cell stands */
    i32 *of_block;                  /* (blocks, blocks) levels of each block of cells */
    i32 *n_cells, *n_below;         /* (n,) cells of each part, and those below a gap */
    SurfaceScratch surface;
} ClusterScratch;

/* Blocks of cells along a side of the grid */
static inline i32 blocks_of(i32 side) { return side / BLOCK_CELLS + 1; }

/* Places the scratch at `memory`; returns its size in bytes. */
static i64 place_scratch(i64 n, i32 side, void *memory, ClusterScratch *s)
{
    uintptr_t end = (uintptr_t)memory;
    TAKE(&end, s->max_gap_m, n);
    TAKE(&end, s->used, n);
    TAKE(&end, s->part, n);
    TAKE(&end, s->divided, n);
    TAKE(&end, s->cluster_of_part, n);
    TAKE(&end, s->ends, n);
    TAKE(&end, s->next_in_row, side);
    TAKE(&end, s->next_in_column, side);
    TAKE(&end, s->latest, side);
    TAKE(&end, s->by_rank, n);
    TAKE(&end, s->by_column, n);
    TAKE(&end, s->by_row, n);
    TAKE(&end, s->spans, n + 2);
    TAKE(&end, s->parent, n + 1);
    TAKE(&end, s->last_rank, n + 1);
    TAKE(&end, s->span_of_rank, n);
    TAKE(&end, s->component_of_root, n + 1);
    TAKE(&end, s->next_of_cluster, 2 * n);
    TAKE(&end, s->cell_of_row, n);
    TAKE(&end, s->row_cells, n);
    TAKE(&end, s->x, n);
    TAKE(&end, s->y, n);
    TAKE(&end, s->width_m, n);
    TAKE(&end, s->on_surface, n);
    TAKE(&end, s->distance_m, n);
    TAKE(&end, s->is_free, n);
    TAKE(&end, s->before_m, n);
    TAKE(&end, s->surface_top_m, n);
    TAKE(&end, s->front_m, n);
    TAKE(&end, s->back_m, n);
    TAKE(&end, s->top_m, n);
    TAKE(&end, s->of_block, blocks_of(side) * blocks_of(side));
    TAKE(&end, s->n_cells, n);
    TAKE(&end, s->n_below, n);
    place_surface_scratch(n, &end, &s->surface);
    return (i64)(end - (uintptr_t)memory);
}

EXPORT i64 modt_cluster_scratch(i64 n_cells, i32 fine_side)
{
    ClusterScratch s;
    return place_scratch(n_cells, fine_side, 0, &s);
}

/* Start of each line among what is counted by line: from counts to running sums. */
static void starts_of(i32 *count, i32 n)
{
    i32 start = 0;
    for (i32 line = 0; line < n; line++) {
        i32 in_line = count[line];
        count[line] = start;
        start += in_line;
    }
}

/* Sorts the places of the used cells on a grid 2^shift times as wide into `by_row`, by a radix sort: by column,
 * then by row, each keeping the order before. */
static void sort_places(const Cells *cells, i64 n_used, int shift, i32 side, const ClusterScratch *s)
{
    i32 *in_row = s->next_in_row, *in_column = s->next_in_column;
    for (i32 line = 0; line < side; line++) {
        in_row[line] = 0;
        in_column[line] = 0;
    }
    for (i64 k = 0; k < n_used; k++) {
        i32 row = cells->row[s->used[k]] >> shift, column = cells->column[s->used[k]] >> shift;
        PROVEN(row >= 0 && row < side && column > 0 && column < side - 1);
        s->by_rank[k] = (Place){(uint16_t)row, (uint16_t)column, (i32)k};
        in_row[row]++;
        in_column[column]++;
    }
    starts_of(in_row, side);
    starts_of(in_column, side);
    for (i64 k = 0; k < n_used; k++)
        s->by_column[in_column[s->by_rank[k].column]++] = s->by_rank[k];
    for (i64 k = 0; k < n_used; k++)
        s->by_row[in_row[s->by_column[k].row]++] = s->by_column[k];
}

/* Unites the used cells that lie in one wide cell to a span; its gap is that of the last of them. Returns how many
 * spans there are. */
static i32 unite_cells(const Cells *cells, i64 n_used, i32 side, const ClusterScratch *s)
{
    const Span empty = {0, INFINITY, -INFINITY, 0.0f};
    const float *low = cells->low, *high = cells->high, *max_gap_m = s->max_gap_m;
    const Place *by_row = s->by_row;
    const i32 *used = s->used;
    i32 *last_rank = s->last_rank, *span_of_rank = s->span_of_rank, n = 0;
    s->spans[0] = s->spans[1] = empty;
    s->spans[0].place = -3 * side; /* no neighbour of any */
    for (i64 k = 0; k < n_used; k++) {
        i32 rank = by_row[k].rank, i = used[rank], place = by_row[k].row * side + by_row[k].column;
        n += place != s->spans[n].place; /* without a branch, as what follows */
        Span *span = &s->spans[n];
        span[1] = empty;
        span->place = place;
        span->low = minf(low[i], span->low);
        span->high = maxf(high[i], span->high);
        span->max_gap_m = max_gap_m[i];
        last_rank[n] = rank;
        span_of_rank[rank] = n;
    }
    return n;
}

/* Sets the parent of each of n spans to the first span of its component. Neighbours whose vertical gap is below
 * the max_gap_m of the earlier one are connected.
 *
 * Spans come in the order of the grid, so of the eight neighbours of span k four come before it: the one to its left,
 * which can only be span k - 1, and three in the row before. When span k is looked at, `latest` holds the last span of
 * each column among those up to k - 2, and span k - 1, too, if that is of an earlier row. So the entries of the three
 * columns around that of k hold the neighbours in the row before, if there are any. Other spans are there, too, of
 * earlier rows, or 0; their places tell that they are no neighbours.
 *
 * A span becomes the child of the least of itself and an ancestor of each neighbour that it is connected with. Any
 * ancestor is of the same component. The second one, the parent's parent, is mostly the root, so that mostly all are
 * the same, and no trees have to be joined. Apart from the joins there are no branches, since no processor foresees
 * which neighbours there are. */
static void find_components(const Span *spans, i32 n, i32 side, i32 *latest, i32 *parent)
{
    const i4 back = {1, side + 1, side, side - 1}; /* from the place of a span to those of its neighbours */
    for (i32 column = 0; column < side; column++)
        latest[column] = 0;
    parent[0] = 0;
    i32 row_start = 0, column_before = 0; /* first place of the row; column of the span before */
    for (i32 k = 1; k <= n; k++) {
        i32 place = spans[k].place;
        for (; place >= row_start + side; row_start += side)
            latest[column_before] = k - 1; /* the row of the span before is an earlier one */
        i32 column = place - row_start;
        const i32 *behind = latest + column - 1; /* to the left behind, behind, and to the right behind */
        const Span *here = &spans[k];

        /* The four that may be neighbours, each in its lane. */
        u4 neighbours[4] = {as_row(here - 1), as_row(&spans[behind[0]]), as_row(&spans[behind[1]]),
                            as_row(&spans[behind[2]])};
        u4 of_neighbours[4];
        transpose(neighbours, of_neighbours);
        i4 places = (i4)of_neighbours[PLACE];
        f4 gap_m = max4(of_neighbours[LOW], spread(here->low)) - min4(of_neighbours[HIGH], spread(here->high));
        i4 connected = (places == place - back) & (gap_m < of_neighbours[MAX_GAP]);

        i4 itself = {k, k, k, k};
        i4 ancestors = {parent[parent[k - 1]], parent[parent[behind[0]]], parent[parent[behind[1]]],
                        parent[parent[behind[2]]]};
        ancestors = (ancestors & connected) | (itself & ~connected);
        i32 least_of_left = ancestors[0] < ancestors[1] ? ancestors[0] : ancestors[1];
        i32 least_of_right = ancestors[2] < ancestors[3] ? ancestors[2] : ancestors[3];
        i32 least = least_of_left < least_of_right ? least_of_left : least_of_right;
        parent[k] = least;
        i4 to_join = (ancestors != itself) & (ancestors != least);
        for (int j = 0; j < 4 && (to_join[0] | to_join[1] | to_join[2] | to_join[3]); j++)
            if (to_join[j])
                join(parent, ancestors[j], least);

        /* Span k - 1 goes into `latest` only now: if it is the left neighbour, the entry of its column had to be
         * the one before until here. */
        latest[column_before] = k - 1;
        column_before = column;
    }
    for (i32 k = 1; k <= n; k++) /* parents come first, so the parent's parent is a root by now */
        parent[k] = parent[parent[k]];
}

/* Gives each used cell the number of its span's component. Components are in the order of the spans, which are in the
 * order of their last cells. Returns how many components there are. */
static i64 number_components(i64 n_used, i32 n, const ClusterScratch *s, i64 *component)
{
    i32 *const number = s->component_of_root;
    const i32 *span_of_rank = s->span_of_rank, *last_rank = s->last_rank, *parent = s->parent;
    i32 count = 0;
    for (i32 k = 0; k <= n; k++)
        number[k] = NONE;
    for (i64 k = 0; k < n_used; k++) {
        i32 span = span_of_rank[k], *of_root = &number[parent[span]];
        if (last_rank[span] == k && *of_root == NONE)
            *of_root = count++;
    }
    for (i64 k = 0; k < n_used; k++)
        component[k] = number[parent[span_of_rank[k]]];
    return count;
}

/* connect, with a shift of 0, and connect_coarse, with 1. Labels each used cell, by rank, with the component of its
 * cell on the grid 2^shift times as coarse (side * side). Returns how many components there are.
 *
 * Cells and components keep their order outside. Inside, spans are in the order of the grid, in which neighbours lie
 * side by side in memory. */
static i64 connect(const Cells *cells, i64 n_used, int shift, i32 side, const ClusterScratch *s, i64 *component)
{
    sort_places(cells, n_used, shift, side, s);
    i32 n = unite_cells(cells, n_used, side, s);
    find_components(s->spans, n, side, s->latest, s->parent);
    return number_components(n_used, n, s, component);
}

/* --------------------------------------------------------------------------------------------- clusters and parts */

/* ClusterSizes of cells.py. */
typedef struct {
    i64 *points, *cell SHAPE(n);
    float *extent_m, *bottom_m, *top_m, *sqrt_range, *beam_m SHAPE(n);
    uint8_t *of_oversized SHAPE(n);
} ClusterSizes;

/* ClusterSizes.of_cells of n clusters, given one point of each cell, and the cluster of each used one, by rank. */
static void measure(const Cells *cells, const PointColumns *sampled, const float *beam_m, const i64 *cluster,
                    i64 n_used, i64 n, const ClusterScratch *s, const ClusterSizes *sizes)
{
    enum { LEAST, GREATEST };
    enum { X, Y, BOTTOM, TOP };
    u4 (*const ends)[2] = s->ends;
    for (i64 g = 0; g < n; g++) {
        ends[g][LEAST] = spread(INFINITY);
        ends[g][GREATEST] = spread(-INFINITY);
        sizes->points[g] = 0;
        sizes->cell[g] = 0;
    }
    i64 stride = (n_used + 3) / 4;
    for (i64 first = 0; first < stride; first++) /* neighbours share clusters: those far apart do not wait */
        for (i64 k = first; k < n_used; k += stride) {
            i64 g = cluster[k];
            i32 i = s->used[k];
            PROVEN(g >= 0 && g < n);
            f4 here = {sampled->x[i], sampled->y[i], cells->low[i], cells->high[i]};
            ends[g][LEAST] = min4(here, ends[g][LEAST]);
            ends[g][GREATEST] = max4(here, ends[g][GREATEST]);
            sizes->points[g] += cells->entries[i];
            sizes->cell[g] = i > sizes->cell[g] ? i : sizes->cell[g];
        }
    for (i64 g = 0; g < n; g++) {
        float width = ends[g][GREATEST][X] - ends[g][LEAST][X], depth = ends[g][GREATEST][Y] - ends[g][LEAST][Y];
        sizes->bottom_m[g] = ends[g][LEAST][BOTTOM];
        sizes->top_m[g] = ends[g][GREATEST][TOP];
        sizes->extent_m[g] = __builtin_sqrtf(width * width + depth * depth);
        sizes->sqrt_range[g] = sampled->sqrt_range[sizes->cell[g]];
        sizes->beam_m[g] = beam_m[sizes->cell[g]];
        sizes->of_oversized[g] = 0;
    }
}

/* CellClusterer, CellTuning and SplitTuning: values by the names that they have there. */
typedef struct {
    i32 coarse_side, fine_side;
    float max_gap_m, max_gap_beams;            /* vertical gap between connected cells */
    float max_extent_m;                        /* of an object */
    float min_extent_m, max_split_sqrt_range;  /* of a cluster that may hold a person and more */
    i64 min_points;                            /* of a part that is split off */
    double step;                               /* side of a fine cell [sqrt(m)] */
} ClusterRules;

/* CellClusterer._may_hold_person */
static int may_hold_person(const ClusterRules *r, const PersonSize *person, const ClusterSizes *s, i64 g)
{
    return s->extent_m[g] > r->min_extent_m && s->top_m[g] > person->min_top_m && s->points[g] >= 2 * r->min_points &&
           s->sqrt_range[g] < r->max_split_sqrt_range;
}

/* CellClusterer._may_be_person */
static int may_be_person_part(const ClusterRules *r, const PersonSize *person, const ClusterSizes *s, i64 p)
{
    return s->points[p] >= r->min_points && fits_person(person, s->extent_m[p], s->bottom_m[p], s->top_m[p]);
}

/* Sizes from cluster n on */
static ClusterSizes sizes_from(const ClusterSizes *s, i64 n)
{
    return (ClusterSizes){.points = s->points + n,
                          .cell = s->cell + n,
                          .extent_m = s->extent_m + n,
                          .bottom_m = s->bottom_m + n,
                          .top_m = s->top_m + n,
                          .sqrt_range = s->sqrt_range + n,
                          .beam_m = s->beam_m + n,
                          .of_oversized = s->of_oversized + n};
}

/* moved: the parts whose `cluster_of_part` is not NONE leave their clusters. A part that stays keeps its number, with
 * no points. Of a cluster that parts leave, the number of points alone is corrected. */
static void move_parts(const Cells *cells, const ClusterScratch *s, i64 n_used, i64 n_parts, i64 *cluster,
                       const ClusterSizes *sizes, const ClusterSizes *parts)
{
    for (i64 p = 0; p < n_parts; p++)
        parts->points[p] = s->cluster_of_part[p] == NONE ? 0 : parts->points[p];
    for (i64 k = 0; k < n_used; k++)
        if (s->cluster_of_part[s->part[k]] != NONE) {
            i32 i = s->used[k];
            sizes->points[cluster[i]] -= cells->entries[i];
            cluster[i] = s->cluster_of_part[s->part[k]];
        }
}

/* CellClusterer._before_surfaces, of n clusters: uses the cells that are free, and sets their `before_m` and
 * `surface_top_m`. Returns how many they are. */
static i64 find_free_cells(const ClusterRules *rules, const StructureRules *structure, const PersonSize *person,
                           const Cells *cells, const PointColumns *sampled, i64 n_cells, const i64 *cluster,
                           const ClusterSizes *sizes, i64 n, const ClusterScratch *s)
{
    /* 1. Clusters that are tried, by a 0 in `next`, and their cells, in `used`. */
    i32 *const next = s->next_of_cluster, rows = 0;
    for (i64 g = 0; g < n; g++) {
        int tried = sizes->points[g] >= 2 * rules->min_points && sizes->top_m[g] > person->min_top_m &&
                    sizes->extent_m[g] >= structure->min_extent_m &&
                    sizes->sqrt_range[g] * sizes->sqrt_range[g] < structure->max_range_m;
        next[g] = tried ? 0 : NONE;
    }
    i64 n_tried = 0, n_free = 0;
    for (i64 i = 0; i < n_cells; i++) {
        s->is_free[i] = 0;
        s->used[n_tried] = (i32)i; /* overwritten by the next, unless its cluster is tried */
        n_tried += next[cluster[i]] != NONE;
    }
    /* 2. Their cells by cluster: `next` counts them, becomes the start of each cluster, and moves on to its end. */
    for (i64 k = 0; k < n_tried; k++)
        next[cluster[s->used[k]]]++;
    for (i64 g = 0; g < n; g++)
        if (next[g] != NONE) {
            i32 of_cluster = next[g];
            next[g] = rows;
            rows += of_cluster;
        }
    for (i64 k = 0; k < n_tried; k++)
        s->cell_of_row[next[cluster[s->used[k]]]++] = s->used[k];
    /* 3. Surfaces of each. What hangs in a canopy is neither on a surface nor free. */
    i32 start = 0;
    for (i64 g = 0; g < n && rows; g++) {
        if (next[g] == NONE)
            continue;
        i32 end = next[g], hanging = 0, m = 0;
        for (i32 k = start; k < end; k++)
            hanging += cells->low[s->cell_of_row[k]] > structure->hanging_m;
        int canopy = hanging >= structure->min_hanging * (end - start);
        for (i32 k = start; k < end; k++) {
            i32 i = s->cell_of_row[k];
            if (canopy && cells->low[i] > structure->hanging_m)
                continue;
            s->row_cells[m] = i;
            s->x[m] = sampled->x[i];
            s->y[m] = sampled->y[i];
            s->width_m[m++] = rules->step * sampled->sqrt_range[i];
        }
        start = end;
        i64 found = find_surfaces(structure, s->x, s->y, s->width_m, m, &s->surface, s->on_surface, s->distance_m);
        if (!found && !canopy)
            continue;
        float top_m = found ? -INFINITY : INFINITY;
        for (i32 k = 0; k < m; k++)
            top_m = s->on_surface[k] ? maxf(cells->high[s->row_cells[k]], top_m) : top_m;
        for (i32 k = 0; k < m; k++) {
            s->is_free[s->row_cells[k]] = !s->on_surface[k];
            s->before_m[s->row_cells[k]] = found ? (float)s->distance_m[k] : FAR_M;
            s->surface_top_m[s->row_cells[k]] = top_m;
        }
    }
    /* 4. The free ones, in their order. */
    for (i64 k = 0; k < n_tried; k++) {
        i32 i = s->used[k];
        s->used[n_free] = i; /* overwritten by the next, unless it is free */
        n_free += s->is_free[i];
    }
    return n_free;
}

/* CellClusterer._leaves_surface: sets `cluster_of_part` of those that leave, which are numbered from n on. */
static void find_leaving(const ClusterRules *rules, const StructureRules *structure, const PersonSize *person,
                         const PersonSize *hidden_person, i64 n_used, const i64 *cluster, const ClusterSizes *sizes,
                         i64 n, const ClusterSizes *parts, i64 n_parts, const ClusterScratch *s)
{
    for (i64 p = 0; p < n_parts; p++) {
        s->front_m[p] = -INFINITY;
        s->back_m[p] = INFINITY;
    }
    for (i64 k = 0; k < n_used; k++) {
        i64 p = s->part[k];
        float before_m = s->before_m[s->used[k]];
        if (!(before_m < INFINITY))
            continue;
        s->front_m[p] = maxf(before_m, s->front_m[p]);
        s->back_m[p] = minf(before_m, s->back_m[p]);
    }
    const float thickness_m = (float)structure->thickness_m;
    for (i64 p = 0; p < n_parts; p++) {
        float front_m = s->front_m[p], back_m = s->back_m[p];
        float extent_m = sizes->extent_m[cluster[parts->cell[p]]];
        int across = back_m < -thickness_m && front_m > -thickness_m && front_m - back_m > structure->min_across_m;
        int before = (front_m > structure->min_before_m || across) && back_m > -structure->max_behind_m;
        int possible = may_be_person_part(rules, person, parts, p) && parts->bottom_m[p] < structure->max_bottom_m;
        int stands_out = parts->points[p] >= structure->min_part_points &&
                         parts->top_m[p] >= structure->min_part_top_m &&
                         parts->extent_m[p] >= structure->min_part_extent_m;
        int hidden = front_m < 0 && back_m > -structure->max_hidden_m &&
                     parts->top_m[p] > s->surface_top_m[parts->cell[p]] + structure->min_above_m &&
                     may_be_person_part(rules, hidden_person, parts, p);
        int leaves = (before && (possible || (extent_m >= structure->oversized_m && stands_out))) || hidden ||
                     (extent_m >= rules->max_extent_m && stands_out);
        s->cluster_of_part[p] = leaves ? (i32)(n + p) : NONE;
    }
}

/* OverhangTuning: values by the names that they have there. */
typedef struct {
    float max_range_m, min_top_m, gap_m, gap_beams, max_gap_m, min_share, max_person_m;
    i32 first_level, last_level;
    i64 min_points;
} OverhangRules;

/* standing_top_m of overhang.py for a cell, given the levels of its block. */
static float standing_top_m(const OverhangRules *rules, i32 around, i32 levels, float high, float beam_m)
{
    float gap_m = maxf(rules->gap_m, rules->gap_beams * beam_m);
    i32 n_empty = (i32)mind(__builtin_ceilf(gap_m * (float)LEVELS_PER_M), N_LEVELS);
    if (!((i64)around >> (rules->first_level + n_empty)))
        return high; /* the levels end below the first gap */
    for (i32 level = rules->first_level; level <= rules->last_level; level++) {
        i64 from_here = (i64)around >> level;
        if (from_here & (((i64)1 << n_empty) - 1) || !(from_here >> n_empty))
            continue;
        unsigned standing = (unsigned)levels & ((1u << level) - 1);
        return standing ? (float)(32 - __builtin_clz(standing)) * (1.0f / LEVELS_PER_M) : 0.0f;
    }
    return high;
}

/* CellClusterer._may_stand_below: uses the cells that stand in clusters that may hold a person and what hangs above,
 * and sets their `top_m`. Returns how many they are. */
static i64 find_standing_cells(const ClusterRules *rules, const StructureRules *structure,
                               const OverhangRules *overhang, const Cells *cells, const float *beam_m, i64 n_cells,
                               const i64 *cluster, const ClusterSizes *sizes, const ClusterScratch *s)
{
    const i32 blocks = blocks_of(rules->fine_side);
    i64 n_used = 0;
    for (i64 k = 0; k < blocks * blocks; k++)
        s->of_block[k] = 0;
    for (i64 i = 0; i < n_cells; i++)
        s->of_block[cells->row[i] / BLOCK_CELLS * blocks + cells->column[i] / BLOCK_CELLS] |= cells->levels[i];
    for (i64 i = 0; i < n_cells; i++) {
        i64 g = cluster[i];
        int tried = sizes->extent_m[g] > rules->min_extent_m && sizes->points[g] >= 2 * rules->min_points &&
                    sizes->top_m[g] > overhang->min_top_m &&
                    sizes->sqrt_range[g] * sizes->sqrt_range[g] < overhang->max_range_m;
        if (!tried || cells->low[i] > structure->hanging_m || overhang->gap_beams * beam_m[i] > overhang->max_gap_m)
            continue;
        i32 around = s->of_block[cells->row[i] / BLOCK_CELLS * blocks + cells->column[i] / BLOCK_CELLS];
        s->top_m[i] = standing_top_m(overhang, around, cells->levels[i], cells->high[i], beam_m[i]);
        s->used[n_used] = (i32)i; /* overwritten by the next, unless it stands */
        n_used += s->top_m[i] > 0;
    }
    return n_used;
}

/* CellClusterer._leaves_overhang: sets `cluster_of_part` of those that leave, which are numbered from n on. */
static void find_leaving_overhang(const ClusterRules *rules, const StructureRules *structure, const PersonSize *person,
                                  const OverhangRules *overhang, const Cells *cells, i64 n_used, i64 n,
                                  const ClusterSizes *parts, i64 n_parts, const ClusterScratch *s)
{
    for (i64 p = 0; p < n_parts; p++) {
        s->n_cells[p] = 0;
        s->n_below[p] = 0;
    }
    for (i64 k = 0; k < n_used; k++) {
        s->n_cells[s->part[k]]++;
        s->n_below[s->part[k]] += s->top_m[s->used[k]] < cells->high[s->used[k]];
    }
    for (i64 p = 0; p < n_parts; p++) {
        int leaves = may_be_person_part(rules, person, parts, p) && parts->points[p] >= overhang->min_points &&
                     parts->top_m[p] < overhang->max_person_m && parts->bottom_m[p] < structure->max_bottom_m &&
                     s->n_below[p] >= overhang->min_share * s->n_cells[p];
        s->cluster_of_part[p] = leaves ? (i32)(n + p) : NONE;
    }
}

/* CellClusterer.cluster: cluster of each cell, given one point of each and the distance of beams there. Returns
 * how many clusters there are: those of the coarse grid, and the parts tried in each step. There is room for the
 * sizes of 4 n_cells. */
EXPORT i64 modt_cluster(const ClusterRules *rules, const StructureRules *structure, const PersonSize *person,
                        const PersonSize *hidden_person, const OverhangRules *overhang, const Cells *cells,
                        const PointColumns *sampled, const float *beam_m, i64 n_cells, void *memory, i64 *cluster,
                        const ClusterSizes *sizes, float *below_m, i64 *hanging)
{
    ClusterScratch scratch, *s = &scratch;
    PROVEN(rules->coarse_side <= rules->fine_side);
    place_scratch(n_cells, rules->fine_side, memory, s);

    /* 1. Clusters on the coarse grid. */
    for (i64 i = 0; i < n_cells; i++) {
        s->max_gap_m[i] = rules->max_gap_m + rules->max_gap_beams * beam_m[i];
        s->used[i] = (i32)i;
    }
    i64 n = connect(cells, n_cells, 1, rules->coarse_side, s, cluster);
    measure(cells, sampled, beam_m, cluster, n_cells, n, s, sizes);

    /* 2. Parts, on the fine grid, of those that are oversized or may hold a person and more. Parts of oversized
     * clusters, and those of a person's size, leave their clusters. */
    i64 n_used = 0;
    for (i64 g = 0; g < n; g++)
        s->divided[g] = sizes->extent_m[g] >= structure->oversized_m || may_hold_person(rules, person, sizes, g);
    for (i64 i = 0; i < n_cells; i++) {
        s->used[n_used] = (i32)i; /* overwritten by the next, unless it is used */
        n_used += s->divided[cluster[i]];
    }
    i64 n_parts = connect(cells, n_used, 0, rules->fine_side, s, s->part);
    ClusterSizes parts = sizes_from(sizes, n);
    measure(cells, sampled, beam_m, s->part, n_used, n_parts, s, &parts);
    for (i64 p = 0; p < n_parts; p++) {
        parts.of_oversized[p] = sizes->extent_m[cluster[parts.cell[p]]] >= structure->oversized_m;
        int leaves = parts.of_oversized[p] || may_be_person_part(rules, person, &parts, p);
        s->cluster_of_part[p] = leaves ? (i32)(n + p) : NONE;
    }
    move_parts(cells, s, n_used, n_parts, cluster, sizes, &parts);
    n += n_parts;

    /* 3. Parts before surfaces, and people behind them. */
    n_used = find_free_cells(rules, structure, person, cells, sampled, n_cells, cluster, sizes, n, s);
    n_parts = connect(cells, n_used, 0, rules->fine_side, s, s->part);
    parts = sizes_from(sizes, n);
    measure(cells, sampled, beam_m, s->part, n_used, n_parts, s, &parts);
    find_leaving(rules, structure, person, hidden_person, n_used, cluster, sizes, n, &parts, n_parts, s);
    move_parts(cells, s, n_used, n_parts, cluster, sizes, &parts);
    n += n_parts;

    /* 4. Who stands below something that hangs leaves it. */
    for (i64 i = 0; i < n_cells; i++) {
        below_m[i] = INFINITY;
        hanging[i] = NONE;
    }
    n_used = find_standing_cells(rules, structure, overhang, cells, beam_m, n_cells, cluster, sizes, s);
    Cells standing = *cells;
    standing.high = s->top_m;
    n_parts = connect(&standing, n_used, 0, rules->fine_side, s, s->part);
    parts = sizes_from(sizes, n);
    measure(&standing, sampled, beam_m, s->part, n_used, n_parts, s, &parts);
    find_leaving_overhang(rules, structure, person, overhang, cells, n_used, n, &parts, n_parts, s);
    for (i64 k = 0; k < n_used; k++) {
        i32 i = s->used[k];
        if (s->cluster_of_part[s->part[k]] == NONE || !(s->top_m[i] < cells->high[i]))
            continue;
        below_m[i] = s->top_m[i];
        hanging[i] = cluster[i];
    }
    move_parts(cells, s, n_used, n_parts, cluster, sizes, &parts);
    return n + n_parts;
}

/* ---------------------------------------------------------------------------------------------- strips of one car */

enum { DIRECTION, RANGE, HEIGHT, ELEVATION, VIEW }; /* rows of the bounds, as in strips.py, and how many they are */

/* ViewBounds of strips.py. */
typedef struct {
    float *min[4], *max[4] SHAPE(4, n);
    float *scale_m SHAPE(n);
} ViewBounds;

/* view_bounds: bounds of n strips, given the number of each cluster among them, or NONE. `height` is that of the
 * points, of which those sampled are at `sample`. */
EXPORT void modt_view_bounds(const Cells *cells, const PointColumns *sampled, const float *height, const i64 *sample,
                             const i64 *cluster_of_cell, i64 n_cells, const i64 *strip_of_cluster, i64 n,
                             const ViewBounds *bounds)
{
    for (int v = 0; v < VIEW; v++)
        for (i64 g = 0; g < n; g++) {
            bounds->min[v][g] = INFINITY;
            bounds->max[v][g] = -INFINITY;
        }
    for (i64 i = n_cells - 1; i >= 0; i--) { /* backwards: the scale that stays is that of the first cell */
        i64 g = strip_of_cluster[cluster_of_cell[i]];
        PROVEN(g >= NONE && g < n);
        if (g == NONE)
            continue;
        float x = sampled->x[i], y = sampled->y[i];
        float direction = pseudo_angle(x, y), range_m = sampled->sqrt_range[i] * sampled->sqrt_range[i];
        float ground = sampled->z[i] - height[sample[i]], low = cells->low[i], high = cells->high[i];
        float least_of[VIEW] = {direction, range_m, low, (low + ground) / range_m};
        float most_of[VIEW] = {direction, range_m, high, (high + ground) / range_m};
        for (int v = 0; v < VIEW; v++) {
            bounds->min[v][g] = minf(least_of[v], bounds->min[v][g]);
            bounds->max[v][g] = maxf(most_of[v], bounds->max[v][g]);
        }
        float across = magnitude(x) + magnitude(y);
        bounds->scale_m[g] = across * across / range_m;
    }
}

/* StripTuning: values by the names that they have there. */
typedef struct {
    float max_diagonal_m, min_width_m, max_width_m, min_top_m, max_top_m, max_bottom_m;
    float max_gap_m, min_gap_beams, max_gap_beams, max_hidden_range_m;
} StripRules;

/* ViewBounds.width_m of strips a and b together, at the scale of a; b may be a */
static inline float width_of(const ViewBounds *bounds, i64 a, i64 b)
{
    float right = minf(bounds->min[DIRECTION][a], bounds->min[DIRECTION][b]);
    float left = maxf(bounds->max[DIRECTION][a], bounds->max[DIRECTION][b]);
    return (left - right) * bounds->scale_m[a];
}

/* strips.fits, of strips a and b together; b may be a */
static inline int fits(const StripRules *rules, const ViewBounds *bounds, i64 a, i64 b)
{
    float width = width_of(bounds, a, b), near = minf(bounds->min[RANGE][a], bounds->min[RANGE][b]);
    float depth = maxf(bounds->max[RANGE][a], bounds->max[RANGE][b]) - near;
    float top = maxf(bounds->max[HEIGHT][a], bounds->max[HEIGHT][b]);
    return width * width + depth * depth < rules->max_diagonal_m * rules->max_diagonal_m && width < rules->max_width_m &&
           top < rules->max_top_m;
}

static inline int may_be_person(const PersonSize *person, const ViewBounds *bounds, i64 a)
{
    return fits_person(person, width_of(bounds, a, a), bounds->min[HEIGHT][a], bounds->max[HEIGHT][a]);
}

/* Whether two strips that overlap in direction are a pair of strips.pairs; `near` is not farther than `far` */
static int one_car(const StripRules *rules, const PersonSize *person, const PersonSize *hidden_person,
                   const ViewBounds *bounds, const float *beam_rad, i64 near, i64 far)
{
    float gap_beams = (bounds->min[ELEVATION][far] - bounds->max[ELEVATION][near]) / beam_rad[far];
    return bounds->min[RANGE][far] - bounds->max[RANGE][near] < rules->max_gap_m && gap_beams > rules->min_gap_beams &&
           gap_beams < rules->max_gap_beams && !may_be_person(person, bounds, near) &&
           !may_be_person(person, bounds, far) &&
           !(bounds->min[RANGE][far] < rules->max_hidden_range_m && may_be_person(hidden_person, bounds, far)) &&
           fits(rules, bounds, near, far) &&
           width_of(bounds, near, far) > rules->min_width_m &&
           maxf(bounds->max[HEIGHT][near], bounds->max[HEIGHT][far]) > rules->min_top_m &&
           minf(bounds->min[HEIGHT][near], bounds->min[HEIGHT][far]) < rules->max_bottom_m;
}

/* merge_strips: first of the strips that make one car with each of n. `order` is that of their least directions,
 * in which the strips that overlap one in direction follow it. Scratch: `parent`, and the bounds of the cars, each
 * at its first. */
EXPORT void modt_merge_strips(const StripRules *rules, const PersonSize *person, const PersonSize *hidden_person,
                              const ViewBounds *bounds, const float *beam_rad, i64 n, const i64 *order, i32 *parent,
                              const ViewBounds *cars, i64 *target)
{
    for (i64 g = 0; g < n; g++)
        parent[g] = (i32)g;
    /* 1. Strips of one car are joined; a strip beyond the end of another one overlaps none that follows it. */
    for (i64 k = 0; k < n; k++)
        for (i64 later = k + 1; later < n; later++) {
            i64 a = order[k], b = order[later];
            if (!(bounds->min[DIRECTION][b] <= bounds->max[DIRECTION][a]))
                break;
            int swap = bounds->min[RANGE][b] < bounds->min[RANGE][a];
            if (one_car(rules, person, hidden_person, bounds, beam_rad, swap ? b : a, swap ? a : b))
                join(parent, (i32)a, (i32)b);
        }
    /* 2. Bounds of each car, from its first strip on, which comes before the others. */
    for (i64 g = 0; g < n; g++) {
        i32 first = parent[g] = parent[parent[g]];
        for (int v = 0; v < VIEW; v++) {
            cars->min[v][first] = first == g ? bounds->min[v][g] : minf(bounds->min[v][g], cars->min[v][first]);
            cars->max[v][first] = first == g ? bounds->max[v][g] : maxf(bounds->max[v][g], cars->max[v][first]);
        }
        cars->scale_m[first] = bounds->scale_m[first];
    }
    for (i64 g = 0; g < n; g++)
        target[g] = fits(rules, cars, parent[g], parent[g]) ? parent[g] : g;
}
