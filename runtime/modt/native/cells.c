/* Cells of a grid: which are occupied, which hang together, and the bounds of what hangs together. */
#include "kernels.h"

/* SqrtRangeGrid.row_column */
EXPORT void modt_row_column(const float *x, const float *y, const float *sqrt_range, i64 n, float scale, i32 centre,
                            i32 *row, i32 *column)
{
    for (i64 i = 0; i < n; i++) {
        float here = scale / sqrt_range[i];
        row[i] = (i32)(x[i] * here + (float)centre);
        column[i] = (i32)(y[i] * here + (float)centre);
    }
}

typedef struct {
    i32 *row, *column;
    float *low, *high;
    i64 *entries;
} Cells;

/* occupied_cells: cells in the order of their last entries. `number` is a table of side * side, NONE throughout
 * before and after. Returns how many; they are the last of the n places of `sample` and of `cells`. */
EXPORT i64 modt_occupied_cells(const i32 *row, const i32 *column, const float *low, const float *high, i64 n,
                               i32 side, i32 *number, i64 *sample, i64 *cell, Cells *cells)
{
    i32 first = (i32)n;
    for (i64 i = n - 1; i >= 0; i--) { /* backwards: the last entry of a cell comes first */
        PROVEN(row[i] >= 0 && row[i] < side && column[i] >= 0 && column[i] < side);
        i32 *here = &number[row[i] * side + column[i]], c = *here;
        if (c == NONE) {
            c = *here = --first;
            sample[c] = i;
            cells->row[c] = row[i];
            cells->column[c] = column[i];
            cells->low[c] = low[i];
            cells->high[c] = high[i];
            cells->entries[c] = 1;
        } else {
            cells->low[c] = least(low[i], cells->low[c]);
            cells->high[c] = most(high[i], cells->high[c]);
            cells->entries[c]++;
        }
        cell[i] = c;
    }
    for (i64 i = 0; i < n; i++)
        cell[i] -= first;
    for (i64 c = first; c < n; c++)
        number[cells->row[c] * side + cells->column[c]] = NONE;
    return n - first;
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

/* One stable pass of a radix sort: n rows in the order of their digits below `base`. */
static void sort_by(const i32 *digit, i32 base, const i32 *rows, i64 n, i32 *next, i32 *sorted)
{
    i32 total = 0;
    for (i32 d = 0; d < base; d++)
        next[d] = 0;
    for (i64 k = 0; k < n; k++)
        next[digit[rows[k]]]++;
    for (i32 d = 0; d < base; d++) {
        i32 count = next[d];
        next[d] = total;
        total += count;
    }
    for (i64 k = 0; k < n; k++)
        sorted[next[digit[rows[k]]]++] = rows[k];
}

typedef struct {
    i32 place;
    float low, high, max_gap_m;
} Span;

static inline int near(const Span *before, const Span *after)
{
    return most(before->low, after->low) - least(before->high, after->high) < before->max_gap_m;
}

/* connect: component of each cell used of n_cells, in the order of their first cells. In the order of the grid the
 * neighbours of a cell are the one before it and up to three of the row before. Scratch: `next` of side, `scratch` of
 * 3 n_cells, `span` of n_cells. */
EXPORT void modt_connect(const Cells *cells, const float *max_gap_m, const uint8_t *use, i64 n_cells, i32 side,
                         i32 *next, i32 *scratch, Span *span, i64 *component)
{
    i32 *order = scratch, *parent = scratch + n_cells, *root = scratch + 2 * n_cells;
    i64 n = 0;
    for (i64 i = 0; i < n_cells; i++) {
        PROVEN(cells->row[i] >= 0 && cells->row[i] < side && cells->column[i] > 0 && cells->column[i] < side - 1);
        root[n] = (i32)i;
        n += use[i];
    }
    sort_by(cells->column, side, root, n, next, parent);
    sort_by(cells->row, side, parent, n, next, order);
    for (i64 k = 0; k < n; k++) {
        i32 i = order[k];
        Span own = {cells->row[i] * side + cells->column[i], cells->low[i], cells->high[i], max_gap_m[i]};
        span[k] = own;
        parent[k] = (i32)k;
    }
    i32 above = 0;
    for (i32 k = 0; k < n; k++) {
        i32 place = span[k].place;
        if (k && span[k - 1].place == place - 1 && near(&span[k - 1], &span[k]))
            join(parent, k - 1, k);
        while (span[above].place < place - side - 1)
            above++;
        for (i32 a = above; span[a].place <= place - side + 1; a++) /* ends at k */
            if (near(&span[a], &span[k]))
                join(parent, a, k);
    }
    for (i64 k = 0; k < n; k++) {
        parent[k] = parent[parent[k]];
        root[order[k]] = parent[k];
    }
    i32 *number = order; /* of the component of each root */
    i64 count = 0;
    for (i64 k = 0; k < n; k++)
        number[k] = NONE;
    for (i64 i = 0; i < n_cells; i++) {
        component[i] = NONE;
        if (!use[i])
            continue;
        if (number[root[i]] == NONE)
            number[root[i]] = (i32)count++;
        component[i] = number[root[i]];
    }
}

typedef struct {
    float *min_x, *max_x, *min_y, *max_y, *bottom, *top;
    i64 *points, *cell;
} Bounds;

/* cluster_bounds: bounds of n clusters of cells, sums of their points, and the last cell of each; a cell may have no
 * cluster. */
EXPORT void modt_cluster_bounds(const Cells *cells, const float *x, const float *y, const i64 *cluster, i64 n_cells,
                                i64 n, Bounds *bounds)
{
    for (i64 g = 0; g < n; g++) {
        bounds->min_x[g] = bounds->min_y[g] = bounds->bottom[g] = INFINITY;
        bounds->max_x[g] = bounds->max_y[g] = bounds->top[g] = -INFINITY;
        bounds->points[g] = bounds->cell[g] = 0;
    }
    for (i64 i = 0; i < n_cells; i++) {
        i64 g = cluster[i];
        PROVEN(g >= NONE && g < n);
        if (g == NONE)
            continue;
        bounds->min_x[g] = least(x[i], bounds->min_x[g]);
        bounds->max_x[g] = most(x[i], bounds->max_x[g]);
        bounds->min_y[g] = least(y[i], bounds->min_y[g]);
        bounds->max_y[g] = most(y[i], bounds->max_y[g]);
        bounds->bottom[g] = least(cells->low[i], bounds->bottom[g]);
        bounds->top[g] = most(cells->high[i], bounds->top[g]);
        bounds->points[g] += cells->entries[i];
        bounds->cell[g] = i;
    }
}
