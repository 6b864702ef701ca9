/* Points and cells by cluster: grouping, sums and headings. A group i has the rows from offsets[i] to
 * offsets[i + 1]; none is empty. */
#include "kernels.h"

/* Hash of the sources that this library is made of. */
EXPORT const char *modt_sources(void) { return MODT_SOURCES; }

/* Groups.from_labels: n groups of the rows labelled 0 to n - 1; returns how many rows that is. */
EXPORT i64 modt_group(const i64 *labels, i64 n_rows, i64 n, i64 *rows, i64 *offsets)
{
    i64 *next = offsets + 1; /* of each group, the place of its next row; its end, when all are placed */
    for (i64 g = 0; g <= n; g++)
        offsets[g] = 0;
    for (i64 i = 0; i < n_rows; i++) {
        PROVEN(labels[i] >= NONE && labels[i] < n);
        if (labels[i] != NONE && labels[i] + 1 < n)
            next[labels[i] + 1]++;
    }
    for (i64 g = 1; g < n; g++)
        next[g] += next[g - 1];
    for (i64 i = 0; i < n_rows; i++)
        if (labels[i] != NONE)
            rows[next[labels[i]]++] = i;
    return offsets[n];
}

typedef struct {
    i64 *index;
    float *xyz[3];
} Rows;

/* copy_runs: n runs of rows, from `begin` to before `end`, one after the other. */
EXPORT void modt_copy_runs(const Rows *rows, const i64 *begin, const i64 *end, i64 n, Rows *copied)
{
    i64 at = 0;
    for (i64 run = 0; run < n; at += end[run] - begin[run], run++)
        for (i64 i = begin[run], to = at; i < end[run]; i++, to++) {
            copied->index[to] = rows->index[i];
            for (int v = 0; v < 3; v++)
                copied->xyz[v][to] = rows->xyz[v][i];
        }
}

/* regrouped: rows of n_groups groups by label, below n, in their order within it, and the count of each. A group has a
 * label, but for the rows `moved`, ascending, which have their own. Scratch: `next` of n. */
EXPORT void modt_regrouped(const Rows *rows, const i64 *offsets, i64 n_groups, const i64 *label, const i64 *moved,
                           const i64 *own, i64 n_moved, i64 n, i64 *next, i64 *count, Rows *sorted)
{
    i64 total = 0;
    for (i64 g = 0; g < n; g++)
        count[g] = 0;
    for (i64 g = 0; g < n_groups; g++) {
        PROVEN(label[g] >= 0 && label[g] < n);
        count[label[g]] += offsets[g + 1] - offsets[g];
    }
    for (i64 m = 0, g = 0; m < n_moved; m++) {
        PROVEN(own[m] >= 0 && own[m] < n);
        while (offsets[g + 1] <= moved[m])
            g++;
        count[label[g]]--, count[own[m]]++;
    }
    for (i64 g = 0; g < n; total += count[g], g++)
        next[g] = total;
    for (i64 g = 0, m = 0; g < n_groups; g++)
        for (i64 i = offsets[g], end; i < offsets[g + 1]; i = end) { /* rows of one label at a time */
            int moves = m < n_moved && moved[m] == i;
            i64 *first = &next[moves ? own[m] : label[g]], to = *first;
            m += moves;
            end = moves ? i + 1 : m < n_moved && moved[m] < offsets[g + 1] ? moved[m] : offsets[g + 1];
            *first += end - i;
            for (i64 k = i; k < end; k++)
                sorted->index[to + k - i] = rows->index[k];
            for (int v = 0; v < 3; v++)
                for (i64 k = i; k < end; k++)
                    sorted->xyz[v][to + k - i] = rows->xyz[v][k];
        }
}

typedef struct {
    const float *x, *y, *z, *height;
    const i64 *index;
} Points;

typedef struct {
    i64 *offsets, *index;
    float *columns; /* x, y, z and z of the ground, of as many members as there are */
} Members;

/* members_of: points by cluster, in input order within a cluster, given the cell of each point and the cluster of
 * each of C cells. */
EXPORT void modt_members(const Points *points, const i64 *cell, i64 n_points, const i64 *cluster, const i64 *entries,
                         i64 n_cells, i64 n, Members *members)
{
    i64 *next = members->offsets + 1; /* of each cluster, the place of its next point; its end, when all are placed */
    i64 total = 0;
    for (i64 g = 0; g <= n; g++)
        members->offsets[g] = 0;
    for (i64 c = 0; c < n_cells; c++)
        if (cluster[c] != NONE)
            next[cluster[c]] += entries[c];
    for (i64 g = 0; g < n; g++) {
        i64 count = next[g];
        next[g] = total;
        total += count;
    }
    float *x = members->columns, *y = x + total, *z = y + total, *ground_z = z + total;
    for (i64 i = 0; i < n_points; i++) {
        PROVEN(cell[i] >= 0 && cell[i] < n_cells && cluster[cell[i]] >= NONE && cluster[cell[i]] < n);
        i64 g = cluster[cell[i]];
        if (g != NONE)
            members->index[next[g]++] = i;
    }
    for (i64 at = 0; at < total; at++) { /* reads may wait for memory together, writes may not: they go in order */
        i64 i = members->index[at];
        members->index[at] = points->index[i];
        x[at] = points->x[i];
        y[at] = points->y[i];
        z[at] = points->z[i];
        ground_z[at] = points->z[i] - points->height[i];
    }
}

/* Sums of the values from `first` to `end` of each of a fixed number of rows of k; they do not wait for one another. */
static ALWAYS_INLINE void sum_rows(const float *values, int rows, i64 k, i64 first, i64 end, double *total)
{
    for (int v = 0; v < rows; v++)
        total[v] = 0.0;
    for (i64 i = first; i < end; i++)
        for (int v = 0; v < rows; v++)
            total[v] += values[v * k + i];
}

/* group_sums: of rows of k values each, as so many rows of n. */
EXPORT void modt_group_sums(const float *values, i64 rows, i64 k, const i64 *offsets, i64 n, double *sums)
{
    enum { TOGETHER = 4 };
    double total[TOGETHER];
    for (; rows >= TOGETHER; rows -= TOGETHER, values += TOGETHER * k, sums += TOGETHER * n)
        for (i64 g = 0; g < n; g++) {
            sum_rows(values, TOGETHER, k, offsets[g], offsets[g + 1], total);
            for (int v = 0; v < TOGETHER; v++)
                sums[v * n + g] = total[v];
        }
    for (; rows > 0; rows--, values += k, sums += n)
        for (i64 g = 0; g < n; g++)
            sum_rows(values, 1, k, offsets[g], offsets[g + 1], sums + g);
}

/* best_headings: index of the best of `headings` directions for at most `limit` of the points at `rows`; cosines and
 * sines are those of the directions, then of the ones across them. */
EXPORT void modt_best_headings(const float *x, const float *y, const i64 *rows, const i64 *offsets, i64 n, i64 limit,
                               const float *cosines, const float *sines, i32 headings, float noise_m, i64 *best)
{
    enum { MOST = 32, LANES = 8 }; /* directions, of which as many are done together */
    float c[2][MOST] = {{0.0f}}, s[2][MOST] = {{0.0f}}, low[2][MOST], high[2][MOST];
    double closeness[MOST];
    i32 padded = (headings + LANES - 1) / LANES * LANES;
    PROVEN(padded <= MOST);
    for (i32 a = 0; a < 2 * headings; a++)
        c[a / headings][a % headings] = cosines[a], s[a / headings][a % headings] = sines[a];
    for (i64 g = 0; g < n; g++) {
        for (i32 a = 0; a < padded; a++) {
            low[0][a] = low[1][a] = INFINITY;
            high[0][a] = high[1][a] = -INFINITY;
            closeness[a] = 0.0;
        }
        i64 stride = (offsets[g + 1] - offsets[g] + limit - 1) / limit;
        for (i64 i = offsets[g]; i < offsets[g + 1]; i += stride) {
            float here_x = x[rows[i]], here_y = y[rows[i]];
            for (int v = 0; v < 2; v++)
                for (i32 a = 0; a < padded; a++) {
                    float across = c[v][a] * here_x + s[v][a] * here_y;
                    low[v][a] = least(across, low[v][a]);
                    high[v][a] = most(across, high[v][a]);
                }
        }
        for (i64 i = offsets[g]; i < offsets[g + 1]; i += stride) {
            float here_x = x[rows[i]], here_y = y[rows[i]];
            for (i32 a = 0; a < padded; a++) {
                float u = c[0][a] * here_x + s[0][a] * here_y, v = c[1][a] * here_x + s[1][a] * here_y;
                float nearest = least(least(u - low[0][a], high[0][a] - u), least(v - low[1][a], high[1][a] - v));
                closeness[a] += 1.0f / most(nearest, noise_m);
            }
        }
        best[g] = 0;
        for (i32 a = 1; a < headings; a++)
            if (closeness[a] > closeness[best[g]])
                best[g] = a;
    }
}

/* reflectance_statistics: of the measured reflectances of each group; points are rows of `width`. */
EXPORT void modt_reflectance_statistics(const float *points, i64 width, const i64 *index, const i64 *offsets, i64 n,
                                        float bright, float dark, double (*statistics)[5])
{
    i64 last = offsets[n];
    for (i64 g = 0; g < n; g++) {
        double total = 0.0, squares = 0.0, *own = statistics[g];
        i64 number = 0, brights = 0, darks = 0;
        float high = -INFINITY;
        for (i64 i = offsets[g]; i < offsets[g + 1]; i++) {
            __builtin_prefetch(&points[index[i + AHEAD < last ? i + AHEAD : i] * width + 3]);
            float r = points[index[i] * width + 3];
            if (r < 0.0f)
                continue;
            number++;
            total += r;
            squares += r * r;
            brights += r > bright;
            darks += r < dark;
            high = most(r, high);
        }
        double n_returns = (double)number, mean = total / n_returns; /* not a number without any */
        double variance = squares / n_returns - mean * mean;
        own[0] = mean, own[1] = __builtin_sqrt(variance < 0.0 ? 0.0 : variance);
        own[2] = number ? (double)high : mean;
        own[3] = (double)brights / n_returns, own[4] = (double)darks / n_returns;
    }
}
