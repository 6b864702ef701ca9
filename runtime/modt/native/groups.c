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

/* copy_runs: members of proposals with their coordinates (3, n_members), in n runs of rows from `begin` to before
 * `end`, one after the other. */
EXPORT void modt_copy_runs(const i64 *members, const float *xyz, i64 n_members, const i64 *begin, const i64 *end,
                           i64 n, i64 *copied_members, float *copied_xyz, i64 n_copied)
{
    i64 at = 0;
    for (i64 run = 0; run < n; at += end[run] - begin[run], run++)
        for (i64 i = begin[run], to = at; i < end[run]; i++, to++) {
            copied_members[to] = members[i];
            for (int v = 0; v < 3; v++)
                copied_xyz[v * n_copied + to] = xyz[v * n_members + i];
        }
}

/* sort_members: members with their coordinates (3, n_members), in n_groups groups, by label, below n, in their order
 * within it, and the count of each label. A member has the label of its group, but for the n_moved rows `moved`,
 * ascending, whose labels are `label_of_moved`. Scratch: `next` of n, the place of the next member of each label. */
EXPORT void modt_sort_members(const i64 *members, const float *xyz, i64 n_members, const i64 *offsets, i64 n_groups,
                              const i64 *label, const i64 *moved, const i64 *label_of_moved, i64 n_moved, i64 n,
                              i64 *next, i64 *count, i64 *sorted_members, float *sorted_xyz)
{
    /* 1. Rows of each label: those of its groups, less those that moved away, and those that moved to it. */
    i64 total = 0;
    for (i64 to = 0; to < n; to++)
        count[to] = 0;
    for (i64 g = 0; g < n_groups; g++) {
        PROVEN(label[g] >= 0 && label[g] < n);
        count[label[g]] += offsets[g + 1] - offsets[g];
    }
    for (i64 m = 0, g = 0; m < n_moved; m++) {
        PROVEN(label_of_moved[m] >= 0 && label_of_moved[m] < n);
        while (offsets[g + 1] <= moved[m])
            g++;
        count[label[g]]--;
        count[label_of_moved[m]]++;
    }
    for (i64 to = 0; to < n; total += count[to], to++)
        next[to] = total;
    /* 2. Rows of one label at a time: one that moved, or all up to the next that moved or the end of the group. */
    for (i64 g = 0, m = 0; g < n_groups; g++)
        for (i64 i = offsets[g], end; i < offsets[g + 1]; i = end) {
            int moves = m < n_moved && moved[m] == i;
            i64 *place = &next[moves ? label_of_moved[m] : label[g]], to = *place;
            m += moves;
            end = moves ? i + 1 : m < n_moved && moved[m] < offsets[g + 1] ? moved[m] : offsets[g + 1];
            *place += end - i;
            for (i64 k = i; k < end; k++)
                sorted_members[to + k - i] = members[k];
            for (int v = 0; v < 3; v++)
                for (i64 k = i; k < end; k++)
                    sorted_xyz[v * n_members + to + k - i] = xyz[v * n_members + k];
        }
}

/* Members of cells.py: m points by cluster, where there is room for all points. */
typedef struct {
    i64 *offsets SHAPE(ends);       /* one more than there are clusters */
    i64 *index SHAPE(room);
    float *columns SHAPE(4, room);  /* x, y, z, and z of the ground beneath */
} Members;

/* Counts the points of clusters into `count`, of each. */
static void count_members(const Clusters *clusters, i64 *count)
{
    for (i64 c = 0; c < clusters->n_cells; c++)
        if (clusters->cluster_of_cell[c] != NONE)
            count[clusters->cluster_of_cell[c]] += clusters->entries[c];
}

/* Places of the points of clusters by cluster, from `next` of each on, which moves past them. The kinds of the others
 * go into those of the sweep. Points are at `places`; without these they are the first ones. */
static ALWAYS_INLINE void place_members(const Clusters *clusters, const i64 *places, const i64 *index, i64 *next,
                                        i64 *place_of_member, int8_t *kind)
{
    const i64 *cell_of_point = clusters->cell_of_point, *cluster_of_cell = clusters->cluster_of_cell;
    const i64 n_points = clusters->n_points;
    for (i64 i = 0; i < n_points; i++) {
        i64 c = cell_of_point[i], place = places ? places[i] : i;
        PROVEN(c >= 0 && c < clusters->n_cells);
        i64 g = cluster_of_cell[c];
        PROVEN(g >= NONE && g < clusters->n);
        if (g == NONE)
            kind[index[place]] = clusters->kind_of_cell[c];
        else
            place_of_member[next[g]++] = place;
    }
}

/* members_of: points by cluster, in input order within a cluster, those of tall clusters before those of low ones.
 * `index` holds the row of each point in the sweep; `kind`, that of every point of it, takes those of the points. */
EXPORT void modt_members(const Clusters *tall, const Clusters *low, const i64 *places, const PointColumns *points,
                         const float *height, const i64 *index, int8_t *kind, const Members *members)
{
    /* 1. Sizes of the clusters, and from them where each begins. As its points are placed, `next` goes from the
     * start of a cluster to its end, which is the offset that it shall hold. */
    i64 *next = members->offsets + 1;
    i64 n = tall->n + low->n, total = 0;
    for (i64 g = 0; g <= n; g++)
        members->offsets[g] = 0;
    count_members(tall, next);
    count_members(low, next + tall->n);
    for (i64 g = 0; g < n; g++) {
        i64 count = next[g];
        next[g] = total;
        total += count;
    }
    /* 2. Points by cluster, then their rows and columns. Reads may wait for memory together, writes may not: they
     * go in order. */
    place_members(tall, 0, index, next, members->index, kind);
    place_members(low, places, index, next + tall->n, members->index, kind);
    i64 *const rows = members->index;
    const float *xyz[] = {points->x, points->y, points->z};
    float *x = members->columns, *y = x + total, *z = y + total, *ground_z = z + total;
    for (i64 m = 0; m < total; m++) {
        i64 i = rows[m];
        rows[m] = index[i];
        kind[index[i]] = MEMBER_KIND;
        x[m] = xyz[0][i];
        y[m] = xyz[1][i];
        z[m] = xyz[2][i];
        ground_z[m] = xyz[2][i] - height[i];
    }
}

typedef double d4 __attribute__((vector_size(32)));
enum { TOGETHER = 4 }; /* rows that are summed together */

/* Sums of the values from `first` to `end` of each of a fixed number of rows of k; they do not wait for one another.
 * Four values are taken at a time, then those that remain. */
static ALWAYS_INLINE void sum_rows(const float *values, int rows, i64 k, i64 first, i64 end, double *total)
{
    d4 sum[TOGETHER] = {{0.0}};
    i64 i = first;
    for (; i + 4 <= end; i += 4)
        for (int v = 0; v < rows; v++) {
            const float *four = values + v * k + i;
            sum[v] += (d4){four[0], four[1], four[2], four[3]};
        }
    for (int v = 0; v < rows; v++)
        total[v] = (sum[v][0] + sum[v][1]) + (sum[v][2] + sum[v][3]);
    for (; i < end; i++)
        for (int v = 0; v < rows; v++)
            total[v] += values[v * k + i];
}

/* group_sums: of rows of k values each, as so many rows of n. */
EXPORT void modt_group_sums(const float *values, i64 rows, i64 k, const i64 *offsets, i64 n, double *sums)
{
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

enum { MOST_HEADINGS = 32, LANES = 8 }; /* room for headings, and how many are computed together */

/* Least and greatest coordinate of a group along each heading, and along what lies across it. */
typedef struct {
    float low[2][MOST_HEADINGS], high[2][MOST_HEADINGS];
} Extent;

/* best_headings: index of the best heading of each of n groups, by at most `limit` of the points at its rows, at a
 * constant stride; without rows, of the points themselves. Cosines and sines are those of the headings, then of what lies across them.
 *
 * A first pass over the points of a group finds its sides at every heading, a second one the closeness of the
 * points to them. Headings are padded to a multiple of LANES with directions of no length, so that both loops are
 * vectorised. */
EXPORT void modt_best_headings(const float *x, const float *y, const i64 *rows, const i64 *offsets, i64 n, i64 limit,
                               const float *cosines, const float *sines, i32 headings, float noise_m, i64 *best)
{
    float c[2][MOST_HEADINGS] = {{0.0f}}, s[2][MOST_HEADINGS] = {{0.0f}};
    double closeness[MOST_HEADINGS];
    Extent e;
    i32 padded = (headings + LANES - 1) / LANES * LANES;
    PROVEN(padded <= MOST_HEADINGS);
    for (i32 a = 0; a < 2 * headings; a++) {
        c[a / headings][a % headings] = cosines[a];
        s[a / headings][a % headings] = sines[a];
    }
    for (i64 g = 0; g < n; g++) {
        for (i32 a = 0; a < padded; a++) {
            e.low[0][a] = e.low[1][a] = INFINITY;
            e.high[0][a] = e.high[1][a] = -INFINITY;
            closeness[a] = 0.0;
        }
        i64 stride = (offsets[g + 1] - offsets[g] + limit - 1) / limit;
        for (i64 i = offsets[g]; i < offsets[g + 1]; i += stride) {
            i64 row = rows ? rows[i] : i;
            float here_x = x[row], here_y = y[row];
            for (int v = 0; v < 2; v++)
                for (i32 a = 0; a < padded; a++) {
                    float along = c[v][a] * here_x + s[v][a] * here_y;
                    e.low[v][a] = minf(along, e.low[v][a]);
                    e.high[v][a] = maxf(along, e.high[v][a]);
                }
        }
        for (i64 i = offsets[g]; i < offsets[g + 1]; i += stride) {
            i64 row = rows ? rows[i] : i;
            float here_x = x[row], here_y = y[row];
            for (i32 a = 0; a < padded; a++) {
                float u = c[0][a] * here_x + s[0][a] * here_y, v = c[1][a] * here_x + s[1][a] * here_y;
                float to_u = minf(u - e.low[0][a], e.high[0][a] - u);
                float to_v = minf(v - e.low[1][a], e.high[1][a] - v);
                closeness[a] += 1.0f / maxf(minf(to_u, to_v), noise_m);
            }
        }
        best[g] = 0;
        for (i32 a = 1; a < headings; a++)
            if (closeness[a] > closeness[best[g]])
                best[g] = a;
    }
}

/* Sums over reflectances, four at a time. */
typedef struct {
    d4 total, squares;
    i4 measured, bright, dark; /* their numbers, negated */
    f4 greatest;
} Reflectances;

/* Adds four reflectances; negative ones are not measured. */
static ALWAYS_INLINE void add_reflectances(Reflectances *sum, f4 reflectance, float bright, float dark)
{
    i4 measured = reflectance >= 0.0f;
    f4 value = (f4)((i4)reflectance & measured), square = value * value;
    sum->total += (d4){value[0], value[1], value[2], value[3]};
    sum->squares += (d4){square[0], square[1], square[2], square[3]};
    sum->measured += measured;
    sum->bright += value > bright;
    sum->dark += measured & (value < dark);
    sum->greatest = max4(value, sum->greatest);
}

/* reflectance_statistics: mean, standard deviation, maximum, share of bright and share of dark ones of the
 * measured reflectances of each of n groups; not a number without any. Points are rows of `width`, of which the
 * fourth is it. */
EXPORT void modt_reflectance_statistics(const float *points, i64 width, const i64 *index, const i64 *offsets, i64 n,
                                        float bright, float dark, double (*statistics)[5])
{
    i64 last = offsets[n] - 1;
    const float *reflectance = points + 3;
    for (i64 g = 0; g < n; g++) {
        Reflectances sum = {0};
        i64 i = offsets[g], end = offsets[g + 1];
        for (; i + 4 <= end; i += 4) {
            __builtin_prefetch(&reflectance[index[i + AHEAD < last ? i + AHEAD : last] * width]);
            f4 four = {reflectance[index[i] * width], reflectance[index[i + 1] * width],
                       reflectance[index[i + 2] * width], reflectance[index[i + 3] * width]};
            add_reflectances(&sum, four, bright, dark);
        }
        for (; i < end; i++)
            add_reflectances(&sum, (f4){reflectance[index[i] * width], NONE, NONE, NONE}, bright, dark);
        double count = -(double)(sum.measured[0] + sum.measured[1] + sum.measured[2] + sum.measured[3]);
        double mean = ((sum.total[0] + sum.total[1]) + (sum.total[2] + sum.total[3])) / count;
        double squares = (sum.squares[0] + sum.squares[1]) + (sum.squares[2] + sum.squares[3]);
        double variance = squares / count - mean * mean;
        float greatest = maxf(maxf(sum.greatest[0], sum.greatest[1]), maxf(sum.greatest[2], sum.greatest[3]));
        double *of_group = statistics[g];
        of_group[0] = mean;
        of_group[1] = __builtin_sqrt(variance < 0.0 ? 0.0 : variance);
        of_group[2] = count > 0.0 ? (double)greatest : mean;
        of_group[3] = -(double)(sum.bright[0] + sum.bright[1] + sum.bright[2] + sum.bright[3]) / count;
        of_group[4] = -(double)(sum.dark[0] + sum.dark[1] + sum.dark[2] + sum.dark[3]) / count;
    }
}
