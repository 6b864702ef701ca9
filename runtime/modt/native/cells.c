/* Cells of a grid: which are occupied, which hang together, and the bounds of what hangs together. */
#include "kernels.h"

typedef struct {
    i32 *row, *column;
    float *low, *high;
    i64 *entries;
} Cells;

typedef struct {
    float *x, *y, *z, *sqrt_range; /* of one point of each cell */
} Samples;

/* Place of a cell in a table of a grid whose side is a multiple of four: neighbours mostly share a cache line. */
static ALWAYS_INLINE i32 place_of(i32 row, i32 column, i32 side)
{
    return (row >> 2) * (4 * side) + (column >> 2) * 16 + (row & 3) * 4 + (column & 3);
}

/* SqrtRangeGrid.row_column, of a point; `scale` is over the square root of its range. */
static ALWAYS_INLINE i32 line_of(float x, float scale, i32 centre) { return (i32)(x * scale + (float)centre); }

/* occupied_cells: cells of n points in the order of their last points, of a grid of cells 1 / `scale` wide. `number` is
 * scratch of side * side. Returns how many; they are the first of the n places of `sample`, `sampled` and `cells`. */
EXPORT i64 modt_occupied_cells(const Samples *points, const float *height, i64 n, float scale, i32 centre, i32 side,
                               i32 *number, i64 *sample, Samples *sampled, i64 *cell, Cells *cells)
{
    i32 count = 0;
    for (i64 i = 0; i < n; i++) {
        float here = scale / points->sqrt_range[i];
        cell[i] = place_of(line_of(points->x[i], here, centre), line_of(points->y[i], here, centre), side);
    }
    for (i64 i = 0; i < n; i++) { /* each point writes its number: that of the last one stays */
        PROVEN(cell[i] >= 0 && cell[i] < side * side);
        __builtin_prefetch(&number[cell[i + AHEAD < n ? i + AHEAD : i]], 1);
        number[cell[i]] = (i32)i;
    }
    for (i64 i = 0; i < n; i++) {
        sample[count] = i; /* overwritten by the next, unless it is the last one */
        count += number[cell[i]] == i;
    }
    for (i32 c = 0; c < count; c++) {
        i64 i = sample[c];
        sampled->x[c] = points->x[i];
        sampled->y[c] = points->y[i];
        sampled->z[c] = points->z[i];
        sampled->sqrt_range[c] = points->sqrt_range[i];
        cells->low[c] = cells->high[c] = height[i];
        cells->entries[c] = 0;
        number[cell[i]] = c;
    }
    for (i64 i = 0; i < n; i++) {
        i64 c = cell[i] = number[cell[i]];
        cells->low[c] = least(height[i], cells->low[c]);
        cells->high[c] = most(height[i], cells->high[c]);
        cells->entries[c]++;
    }
    for (i32 c = 0; c < count; c++) {
        float here = scale / sampled->sqrt_range[c];
        cells->row[c] = line_of(sampled->x[c], here, centre);
        cells->column[c] = line_of(sampled->y[c], here, centre);
    }
    return count;
}

/* Rem's union: a parent is never greater than its child, so a root is the least of its component. */
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

typedef struct {
    uint16_t row, column; /* of a grid of a side below 2^16 */
    i32 cell;
} Place;

/* Places of the cells used, of a grid 2^shift times as wide, in its order, by a radix sort; returns how many. Scratch:
 * `next` of 2 side, `half` of n_cells. */
static i32 sort_places(const Cells *cells, const uint8_t *use, i64 n_cells, int shift, i32 side, i32 *next, Place *half,
                       Place *sorted)
{
    i32 *of_row = next, *of_column = next + side, used = 0, rows = 0, columns = 0;
    for (i32 d = 0; d < side; d++)
        of_row[d] = of_column[d] = 0;
    for (i64 i = 0; i < n_cells; i++) {
        i32 row = cells->row[i] >> shift, column = cells->column[i] >> shift;
        PROVEN(row >= 0 && row < side && column > 0 && column < side - 1);
        sorted[used] = (Place){(uint16_t)row, (uint16_t)column, (i32)i}; /* overwritten by the next, unless it is used */
        used += use[i], of_row[row] += use[i], of_column[column] += use[i];
    }
    for (i32 d = 0; d < side; d++) {
        i32 in_row = of_row[d], in_column = of_column[d];
        of_row[d] = rows, of_column[d] = columns;
        rows += in_row, columns += in_column;
    }
    for (i32 k = 0; k < used; k++)
        half[of_column[sorted[k].column]++] = sorted[k];
    for (i32 k = 0; k < used; k++)
        sorted[of_row[half[k].row]++] = half[k];
    return used;
}

typedef struct {
    i32 place;
    float low, high, max_gap_m;
} Span;

/* First cell of the component of each of n cells in the order of the grid, from 1 on, where the neighbours of a cell are
 * the one before it and up to three of the row before; the cell 0 is nowhere. Scratch: `latest`, of `side`. Without
 * branches, but for the few cells that connect components, since no processor foresees which neighbours there are. */
static void find_components(const Span *span, i32 n, i32 side, i32 *latest, i32 *parent)
{
    const i4 back = {1, side + 1, side, side - 1};
    for (i32 c = 0; c < side; c++)
        latest[c] = 0;
    parent[0] = 0;
    for (i32 k = 1, start = 0, before = 0; k <= n; k++) {
        i32 place = span[k].place;
        for (; place >= start + side; start += side)
            latest[before] = k - 1;
        i32 column = place - start, *over = latest + column - 1;
        const Span *own = &span[k], *left = own - 1;
        const Span *beyond = &span[over[0]], *above = &span[over[1]], *ahead = &span[over[2]];
        i4 places = {left->place, beyond->place, above->place, ahead->place};
        f4 low = {left->low, beyond->low, above->low, ahead->low};
        f4 high = {left->high, beyond->high, above->high, ahead->high};
        f4 max_gap_m = {left->max_gap_m, beyond->max_gap_m, above->max_gap_m, ahead->max_gap_m};
        f4 gap_m = most4(low, spread(own->low)) - least4(high, spread(own->high));
        i4 joined = (places == place - back) & (gap_m < max_gap_m), alone = {k, k, k, k};
        i4 roots = {parent[parent[k - 1]], parent[parent[over[0]]], parent[parent[over[1]]], parent[parent[over[2]]]};
        roots = (roots & joined) | (alone & ~joined);
        i32 one = roots[0] < roots[1] ? roots[0] : roots[1], other = roots[2] < roots[3] ? roots[2] : roots[3];
        parent[k] = one = one < other ? one : other;
        i4 apart = (roots != alone) & (roots != one);
        for (int j = 0; j < 4 && (apart[0] | apart[1] | apart[2] | apart[3]); j++)
            if (apart[j])
                join(parent, roots[j], one);
        latest[before] = k - 1; /* only now: the neighbour above it was looked up last */
        before = column;
    }
    for (i32 k = 1; k <= n; k++)
        parent[k] = parent[parent[k]];
}

/* connect and connect_coarse: component of the cell 2^shift times as wide, of a grid of side * side, in which each cell
 * used lies, NONE for the others; in the order of the first of their wide cells, those in the order of their last
 * cells. Returns how many components there are. Scratch: `next`, of 2 side + 10 n_cells + 8. */
static i64 connect(const Cells *cells, const float *max_gap_m, const uint8_t *use, i64 n_cells, int shift, i32 side,
                   i32 *next, i64 *component)
{
    Span *span = (Span *)(next + 2 * side);
    Place *order = (Place *)(span + n_cells + 1);
    i32 *parent = (i32 *)(order + n_cells), *wide = parent + n_cells + 1, *last = wide + n_cells;
    i32 used = sort_places(cells, use, n_cells, shift, side, next, (Place *)span, order), n = 0, count = 0;
    f4 none = spread(INFINITY), ends = none; /* least height, and the greatest negated */
    span[0] = (Span){-3 * side, INFINITY, -INFINITY, 0.0f};
    last[0] = NONE;
    for (i64 i = 0; i < n_cells; i++)
        wide[i] = 0; /* that of the cells not used */
    for (i32 k = 0; k < used; k++) {
        i32 i = order[k].cell, place = order[k].row * side + order[k].column, begins = -(place != span[n].place);
        i4 anew = {begins, begins, begins, begins};
        n -= begins;
        ends = least4((f4){cells->low[i], -cells->high[i]}, (f4)(((i4)none & anew) | ((i4)ends & ~anew)));
        span[n] = (Span){place, ends[0], -ends[1], max_gap_m[i]};
        last[n] = i;
        wide[i] = n;
    }
    find_components(span, n, side, next, parent);
    i32 *number = (i32 *)order, *ended = last + n_cells + 1, m = 0; /* of each root's component; wide cells */
    for (i32 c = 0; c <= n; c++)
        number[c] = NONE;
    for (i64 i = 0; i < n_cells; i++) {
        ended[m] = wide[i];
        m += last[wide[i]] == i;
    }
    for (i32 k = 0; k < m; k++)
        if (number[parent[ended[k]]] == NONE)
            number[parent[ended[k]]] = count++;
    for (i64 i = 0; i < n_cells; i++)
        component[i] = number[parent[wide[i]]];
    return count;
}

typedef struct {
    i64 *points, *cell;
    float *extent_m, *bottom_m, *top_m, *sqrt_range, *beam_m;
    uint8_t *is_part;
} Sizes;

/* ClusterSizes.of_cells of n clusters. Scratch: `ends`, the least and the greatest x, y and height of each. */
static void measure(const Cells *cells, const Samples *points, const float *beam_m, const i64 *cluster, i64 n_cells,
                    i64 n, u4 (*ends)[2], const Sizes *sizes)
{
    for (i64 g = 0; g < n; g++) {
        ends[g][0] = spread(INFINITY), ends[g][1] = spread(-INFINITY);
        sizes->points[g] = sizes->cell[g] = 0;
    }
    i64 part = (n_cells + 3) / 4;
    for (i64 k = 0; k < part; k++) /* neighbours share clusters: those far apart do not wait for one another */
        for (i64 i = k; i < n_cells; i += part) {
            i64 g = cluster[i];
            PROVEN(g >= NONE && g < n);
            if (g == NONE)
                continue;
            f4 low = {points->x[i], points->y[i], cells->low[i]}, high = {points->x[i], points->y[i], cells->high[i]};
            ends[g][0] = least4(low, ends[g][0]), ends[g][1] = most4(high, ends[g][1]);
            sizes->points[g] += cells->entries[i];
            sizes->cell[g] = i > sizes->cell[g] ? i : sizes->cell[g];
        }
    for (i64 g = 0; g < n; g++) {
        float width = ends[g][1][0] - ends[g][0][0], depth = ends[g][1][1] - ends[g][0][1];
        sizes->bottom_m[g] = ends[g][0][2], sizes->top_m[g] = ends[g][1][2];
        sizes->extent_m[g] = __builtin_sqrtf(width * width + depth * depth);
        sizes->sqrt_range[g] = points->sqrt_range[sizes->cell[g]];
        sizes->beam_m[g] = beam_m[sizes->cell[g]];
        sizes->is_part[g] = 0;
    }
}

typedef struct {
    float max_gap_m, max_gap_beams, max_extent_m, min_split_m, max_split_sqrt_range, min_person_points;
    float min_extent_m, max_person_m, min_top_m, max_top_m, min_height_m; /* of a person */
} Rules;

/* CellClusterer._may_hold_person, or an oversized cluster */
static int may_split(const Rules *r, const Sizes *s, i64 g)
{
    return s->extent_m[g] >= r->max_extent_m ||
           (s->extent_m[g] > r->min_split_m && s->top_m[g] > r->min_top_m &&
            s->points[g] >= 2 * (i64)r->min_person_points && s->sqrt_range[g] < r->max_split_sqrt_range);
}

/* CellClusterer._may_be_person */
static int may_be_person(const Rules *r, const Sizes *s, i64 g)
{
    return s->points[g] >= (i64)r->min_person_points && s->extent_m[g] > r->min_extent_m &&
           s->extent_m[g] < r->max_person_m && s->top_m[g] > r->min_top_m && s->top_m[g] < r->max_top_m &&
           s->top_m[g] - s->bottom_m[g] > r->min_height_m;
}

/* CellClusterer.cluster: cluster of each cell; returns how many there are. There is room for the sizes of 2 n_cells.
 * Scratch: `work`, of 2 fine_side + 15 n_cells + 8. */
EXPORT i64 modt_cluster(const Rules *rules, const Cells *cells, const Samples *points, const float *beam_m,
                        i64 n_cells, i32 coarse_side, i32 fine_side, i32 *work, i64 *cluster, const Sizes *sizes)
{
    i64 *part = (i64 *)work; /* 2 n_cells; then 10 n_cells + 8 and two sides for connect, of which measure takes 8 */
    i32 *next = work + 2 * n_cells, *number = next + 2 * fine_side + 10 * n_cells + 8;
    float *gap_m = (float *)(number + n_cells);
    u4 (*ends)[2] = (u4 (*)[2])next;
    uint8_t *use = (uint8_t *)(gap_m + n_cells);
    for (i64 i = 0; i < n_cells; i++) {
        gap_m[i] = rules->max_gap_m + rules->max_gap_beams * beam_m[i];
        use[i] = 1;
    }
    i64 n = connect(cells, gap_m, use, n_cells, 1, coarse_side, next, cluster);
    measure(cells, points, beam_m, cluster, n_cells, n, ends, sizes);
    for (i64 g = 0; g < n; g++)
        number[g] = may_split(rules, sizes, g);
    for (i64 i = 0; i < n_cells; i++)
        use[i] = (uint8_t)number[cluster[i]];
    i64 parts = connect(cells, gap_m, use, n_cells, 0, fine_side, next, part);
    Sizes own = {sizes->points + n,     sizes->cell + n,   sizes->extent_m + n, sizes->bottom_m + n, sizes->top_m + n,
                 sizes->sqrt_range + n, sizes->beam_m + n, sizes->is_part + n};
    measure(cells, points, beam_m, part, n_cells, parts, ends, &own);
    for (i64 p = 0; p < parts; p++) {
        i64 owner = cluster[own.cell[p]];
        own.is_part[p] = sizes->extent_m[owner] >= rules->max_extent_m;
        number[p] = own.is_part[p] || may_be_person(rules, &own, p) ? (i32)(n + p) : NONE;
        own.points[p] = number[p] == NONE ? 0 : own.points[p];
        sizes->points[owner] -= own.points[p];
    }
    for (i64 i = 0; i < n_cells; i++)
        if (part[i] != NONE && number[part[i]] != NONE)
            cluster[i] = number[part[i]];
    return n + parts;
}

/* view_bounds: bounds of n clusters of cells in direction, range, height and elevation, and their scale; `number` of a
 * cluster is its place among the n, or NONE. `height` is that of the points, of which those sampled are at `sample`. */
EXPORT void modt_view_bounds(const Cells *cells, const Samples *sampled, const float *height, const i64 *sample,
                             const i64 *cluster, i64 n_cells, const i64 *number, i64 n, float *const bounds[8],
                             float *scale_m)
{
    float *const *low = bounds, *const *high = bounds + 4;
    for (int v = 0; v < 4; v++)
        for (i64 g = 0; g < n; g++) {
            low[v][g] = INFINITY;
            high[v][g] = -INFINITY;
        }
    for (i64 i = n_cells - 1; i >= 0; i--) { /* backwards: the scale is that of the first cell */
        i64 g = number[cluster[i]];
        PROVEN(g >= NONE && g < n);
        if (g == NONE)
            continue;
        float x = sampled->x[i], y = sampled->y[i], across = magnitude(x) + magnitude(y);
        float turn = y / most(across, 1e-6f), range_m = sampled->sqrt_range[i] * sampled->sqrt_range[i];
        float ground = sampled->z[i] - height[sample[i]];
        float least_of[4] = {(x < 0.0f ? 2.0f - turn : turn) + 1.0f, range_m, cells->low[i],
                             (cells->low[i] + ground) / range_m};
        float most_of[4] = {least_of[0], range_m, cells->high[i], (cells->high[i] + ground) / range_m};
        for (int v = 0; v < 4; v++) {
            low[v][g] = least(least_of[v], low[v][g]);
            high[v][g] = most(most_of[v], high[v][g]);
        }
        scale_m[g] = across * across / range_m;
    }
}

typedef struct {
    float max_gap_m, min_gap_beams, max_gap_beams, min_width_m, max_width_m, min_top_m, max_top_m, max_bottom_m;
    float max_diagonal_m, max_person_width_m, min_person_top_m, min_person_height_m;
} Strips;

enum { DIRECTION, RANGE, HEIGHT, ELEVATION, VIEW }; /* rows of the least values, then of the greatest */

/* ViewBounds.width_m and strips.fits, of one cluster or of two; `b` may be `a` */
static inline float width_of(float *const bounds[8], const float *scale_m, i64 a, i64 b)
{
    float right = least(bounds[DIRECTION][a], bounds[DIRECTION][b]);
    return (most(bounds[VIEW + DIRECTION][a], bounds[VIEW + DIRECTION][b]) - right) * scale_m[a];
}

static inline int fits(const Strips *s, float *const bounds[8], const float *scale_m, i64 a, i64 b)
{
    float width = width_of(bounds, scale_m, a, b), near = least(bounds[RANGE][a], bounds[RANGE][b]);
    float depth = most(bounds[VIEW + RANGE][a], bounds[VIEW + RANGE][b]) - near;
    return width * width + depth * depth < s->max_diagonal_m * s->max_diagonal_m && width < s->max_width_m &&
           most(bounds[VIEW + HEIGHT][a], bounds[VIEW + HEIGHT][b]) < s->max_top_m;
}

static inline int person_like(const Strips *s, float *const bounds[8], const float *scale_m, i64 a)
{
    float top = bounds[VIEW + HEIGHT][a];
    return width_of(bounds, scale_m, a, a) < s->max_person_width_m && top > s->min_person_top_m &&
           top - bounds[HEIGHT][a] > s->min_person_height_m;
}

/* Of strips.pairs; `a` is not farther than `b` */
static int one_car(const Strips *s, float *const bounds[8], const float *scale_m, const float *beam_rad, i64 a, i64 b)
{
    float beams = (bounds[ELEVATION][b] - bounds[VIEW + ELEVATION][a]) / beam_rad[b];
    return bounds[RANGE][b] - bounds[VIEW + RANGE][a] < s->max_gap_m && beams > s->min_gap_beams &&
           beams < s->max_gap_beams && !person_like(s, bounds, scale_m, a) && !person_like(s, bounds, scale_m, b) &&
           fits(s, bounds, scale_m, a, b) && width_of(bounds, scale_m, a, b) > s->min_width_m &&
           most(bounds[VIEW + HEIGHT][a], bounds[VIEW + HEIGHT][b]) > s->min_top_m &&
           least(bounds[HEIGHT][a], bounds[HEIGHT][b]) < s->max_bottom_m;
}

/* merge_strips: first of the clusters that make one car with each of n; `order` is that of their least directions.
 * Scratch: `parent`, and bounds of cars. */
EXPORT void modt_merge_strips(const Strips *s, float *const bounds[8], const float *scale_m, const float *beam_rad,
                              i64 n, const i64 *order, i32 *parent, float *const cars[8], i64 *target)
{
    for (i64 g = 0; g < n; g++)
        parent[g] = (i32)g;
    for (i64 k = 0; k < n; k++)
        for (i64 other = k + 1; other < n; other++) {
            i64 a = order[k], b = order[other], swap = bounds[RANGE][b] < bounds[RANGE][a];
            if (!(bounds[DIRECTION][b] <= bounds[VIEW + DIRECTION][a]))
                break;
            if (one_car(s, bounds, scale_m, beam_rad, swap ? b : a, swap ? a : b))
                join(parent, (i32)a, (i32)b);
        }
    for (i64 g = 0; g < n; g++) {
        i32 first = parent[g] = parent[parent[g]];
        for (int v = 0; v < VIEW; v++) {
            cars[v][first] = first == g ? bounds[v][g] : least(bounds[v][g], cars[v][first]);
            cars[VIEW + v][first] = first == g ? bounds[VIEW + v][g] : most(bounds[VIEW + v][g], cars[VIEW + v][first]);
        }
    }
    for (i64 g = 0; g < n; g++)
        target[g] = fits(s, cars, scale_m, parent[g], parent[g]) ? parent[g] : g;
}
